"""identification.json: what an identification says, for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.report.identification.words import doubt_sentences, next_command, verdict_sentence
from rsea_ros.signals import Fault

SCHEMA = 1


def identification_json(identification: Identification) -> dict[str, Any]:
    """Return the contents of identification.json. No number in it is infinite or NaN: such are null."""
    i = identification
    return {
        "schema": SCHEMA,
        "rig": i.rig.name,
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
        "statements": [*doubt_sentences(i), *i.statements],
        "notes": [*i.notes, *i.clocks],
    }  # fmt: skip


def fault_json(fault: Fault) -> dict[str, Any]:
    """Return a fault of the data as it stands in the result files."""
    size = {} if fault.size is None else {"size": finite(fault.size), "unit": fault.unit}
    detail = {"detail": fault.detail} if fault.detail else {}
    return {"kind": fault.kind, "channel": fault.channel, "share": finite(fault.share), **size, **detail}


def parameter(p: ParameterEstimate) -> dict[str, Any]:
    """Return a parameter as it stands in the result files."""
    return {
        "value": finite(p.value),
        "unit": p.unit,
        "ci95": [finite(v) for v in p.ci95],
        "start": finite(p.start),
        "told_by_data": finite(p.told_by_data),
    }


def numbers(values: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return finite numbers by name, None for others."""
    return {name: None if value is None else finite(value) for name, value in values.items()}


def strict(value: Any) -> Any:
    """Return what JSON can hold: None for each number that is infinite or NaN, however deep."""
    if isinstance(value, Mapping):
        return {key: strict(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [strict(item) for item in value]
    return finite(value) if isinstance(value, float) else value


def finite(value: float) -> float | None:
    """Return a number as JSON can hold it: None when it is infinite or NaN."""
    return float(value) if math.isfinite(value) else None
