"""experiment.json of a session of experiments, for programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rsea_ros.experiment.campaign import Campaign, CampaignOutcome
from rsea_ros.report.campaign.words import end_sentence
from rsea_ros.report.experiment.json import SCHEMA, proof_json, proposal_json
from rsea_ros.report.json_values import strict


def campaign_json(outcome: CampaignOutcome, campaign: Campaign) -> Mapping[str, Any]:
    """Return the contents of experiment.json of a session."""
    rounds = [
        {
            "probability": r.weighing.probability,
            "times_noise_left": r.weighing.left,
            "run": None if r.proposal is None else proposal_json(r.proposal),
        }
        for r in outcome.rounds
    ]
    body = {
        "schema": SCHEMA,
        "end": outcome.end,
        "sentence": end_sentence(outcome),
        "cause": outcome.cause,
        "why": outcome.why,
        "one_of": [] if outcome.shared is None else list(outcome.shared.names),
        "torque_needed": None if outcome.shared is None else outcome.shared.torque,
        "seconds": outcome.seconds,
        "causes": list(campaign.causes),
        "limits": campaign.asked.limits.finite_limits(),
        "rounds": rounds,
        "no_run_separates": [proof_json(x) for x in outcome.proofs],
    }
    contents: Mapping[str, Any] = strict(body)
    return contents
