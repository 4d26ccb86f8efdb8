"""identification.json: an identification for programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.report.identification.words import doubt_sentences, next_command, verdict_sentence
from rsea_ros.report.json_values import fault_json, finite, numbers
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.rig.json import rig_json

SCHEMA = 1


def identification_json(identification: Identification) -> dict[str, Any]:
    """Return the contents of identification.json; infinite numbers and NaN are null."""
    i = identification
    return {
        "schema": SCHEMA,
        "rig": i.rig.name,
        **rig_json(i.rig_choice, i.remarks),
        "verdict": i.verdict,
        "sentence": verdict_sentence(i),
        "next": next_command(i) or None,
        "data": {"bags": list(i.sources), "duration_s": finite(i.duration), "rate_hz": finite(i.rate),
                 "faults": [fault_json(f) for f in i.faults]},
        "parameters": {p.name: parameter(p) for p in i.parameters},
        "correlation": {
            "names": [p.name for p in i.parameters],
            "matrix": [[finite(v) for v in row] for row in i.correlation],
        },
        "residual_rms": numbers(i.residual_rms),
        "noise_rms": numbers(i.noise_rms),
        "times_noise": numbers(i.times_noise),
        "fit_percent": numbers(i.fit_percent),
        "responses": [
            {"input": r.input, "output": r.output, "method": r.method, "lines": len(r.frequency),
             "from_hz": finite(r.frequency[0]), "to_hz": finite(r.frequency[-1])}
            for r in i.responses if len(r.frequency)
        ],
        **({"statics": numbers(asdict(i.statics))} if i.statics else {}),
        "alternatives": list(i.alternatives),
        "statements": [*doubt_sentences(i), *remark_sentences(i.remarks)],
        "notes": [*i.notes, *remark_sentences(i.clocks)],
    }  # fmt: skip


def parameter(p: ParameterEstimate) -> dict[str, Any]:
    """Return a parameter for the result files."""
    return {
        "value": finite(p.value),
        "unit": p.unit,
        "ci95": [finite(v) for v in p.ci95],
        "start": finite(p.start),
        "told_by_data": finite(p.told_by_data),
    }
