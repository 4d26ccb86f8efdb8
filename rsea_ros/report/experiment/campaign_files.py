"""The files of a session of experiments: experiment.json, the runs' commands, model.yaml, report.html."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rsea_ros.experiment.campaign import Campaign, Outcome
from rsea_ros.experiment.run_file import run_text
from rsea_ros.model.rig_file import rig_text
from rsea_ros.new_files import NewFiles
from rsea_ros.report.experiment.campaign_page import campaign_page
from rsea_ros.report.experiment.campaign_words import end_sentence
from rsea_ros.report.experiment.json import SCHEMA, proof_json, proposal_json
from rsea_ros.report.json_values import json_text, strict, with_provenance
from rsea_ros.report.provenance import Provenance

JSON, MODEL, REPORT = NAMES = ("experiment.json", "model.yaml", "report.html")


def write_campaign(
    outcome: Outcome,
    campaign: Campaign,
    out: Path,
    notes: tuple[str, ...] = (),
    provenance: Provenance | None = None,
) -> Path:
    """Write the files beside the bags of the runs; return the report's path.

    model.yaml: the rig with the likeliest cause and the values of all records together.
    """
    best = outcome.weighing.hypotheses()[0]
    with NewFiles(out) as new:
        for k, r in enumerate(outcome.rounds, 1):
            if r.proposal is not None:
                new.write(f"run-{k}.csv", run_text(r.proposal.command, r.proposal.rate))
        new.write(JSON, json_text(with_provenance(campaign_json(outcome, campaign), provenance)))
        new.write(MODEL, rig_text(best.rig))
        text = campaign_page(outcome, campaign.rig.name, campaign.asked.limits, notes, provenance)
        return new.write(REPORT, text)


def campaign_json(outcome: Outcome, campaign: Campaign) -> Mapping[str, Any]:
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
        "seconds": outcome.seconds,
        "causes": list(campaign.causes),
        "limits": campaign.asked.limits.stated(),
        "rounds": rounds,
        "no_run_separates": [proof_json(x) for x in outcome.proofs],
    }
    contents: Mapping[str, Any] = strict(body)
    return contents
