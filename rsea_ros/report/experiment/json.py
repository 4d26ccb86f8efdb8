"""experiment.json: a designed run, for programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rsea_ros.experiment.advice import Advice, Proof
from rsea_ros.experiment.proposal import LEVEL, Proposal
from rsea_ros.report.experiment.words import proof_words, verdict
from rsea_ros.report.json_values import strict

SCHEMA = 1


def advice_json(advice: Advice) -> dict[str, Any]:
    """Return the contents of experiment.json. Infinite numbers are null."""
    p = advice.proposal
    body = {
        "schema": SCHEMA,
        "sentence": verdict(advice),
        "causes": {h.name: h.probability for h in advice.hypotheses},
        "excluded": dict(advice.excluded),
        "limits": advice.asked.limits.finite_limits(),
        "limits_hold_with_probability": LEVEL,
        "run": None if p is None else proposal_json(p),
        "no_run_separates": [proof_json(x) for x in advice.proofs],
    }
    contents: dict[str, Any] = strict(body)
    return contents


def proposal_json(p: Proposal) -> Mapping[str, Any]:
    """Return a run: its shape, its expected separation, its peaks."""
    pairs = [
        {"true": a, "rival": b, "separation": float(p.table[i, j])}
        for i, a in enumerate(p.names)
        for j, b in enumerate(p.names)
        if i != j
    ]
    return {
        "shape": asdict(p.shape),
        "duration_s": p.duration,
        "rate_hz": p.rate,
        "decided": p.decided,
        "separations": pairs,
        "peaks_expected": p.peaks.expected,
        "peaks_at_level": p.peaks.at_level,
        "narrowed_nats": p.sharpened,
        "shapes_judged": p.tried,
    }


def proof_json(proof: Proof) -> dict[str, Any]:
    """Return a pair that no run separates."""
    b = proof.bound
    return {
        "causes": [b.true, b.rival],
        "at_most": b.most,
        "duration_s": b.duration,
        "band_hz": [float(b.frequency[0]), float(b.frequency[-1])],
        "measure_apart": [{"what": a.what, "separation": a.separation} for a in proof.apart],
        "sentence": proof_words(proof),
    }
