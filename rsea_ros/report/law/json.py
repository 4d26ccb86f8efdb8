"""law.json: a law that no effect covers, for programs."""

from __future__ import annotations

from typing import Any

from rsea_ros.laws.law import Law, LawResult, equation_of
from rsea_ros.report.json_values import numbers
from rsea_ros.report.law.words import headline

SCHEMA = 1


def law_json(result: LawResult) -> dict[str, Any]:
    """Return the contents of law.json."""
    return {
        "schema": SCHEMA,
        "rig": result.rig_name,
        "sentence": headline(result),
        "data": {"bags": list(result.sources), "duration_s": result.duration},
        "at_noise_floor": result.at_floor,
        "gain": {
            "holdout": result.gain,
            "holdout_ci95": list(result.gain_ci95),
            "share_of_excess": result.share,
        },
        "residual_rms": {"before": numbers(result.before), "after": numbers(result.after)},
        "noise_rms": numbers(result.noise),
        "laws": [_law(w.law) for w in result.laws],
        "depends_on": [
            {
                "what": d.regressor,
                "at": d.place,
                "share": d.share,
                "se": d.se,
                "of_what_the_law_leaves": d.beside,
            }
            for d in result.dependences
        ],
        "tried": [
            {"at": t.place, "terms": list(t.terms), "left": t.left, "chosen": t.chosen} for t in result.tried
        ],
    }


def _law(law: Law) -> dict[str, Any]:
    parameters = {}
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        parameters[c] = {"value": part.coefficient, "unit": part.term.unit, "ci95": list(part.ci95 or ())}
        if s:
            parameters[s] = {
                "value": part.shape,
                "unit": part.term.shape_unit,
                "ci95": list(part.shape_ci95 or ()),
            }
    return {
        "name": law.name, "file": f"{law.name}.py", "at": law.place, "depends_on": law.regressor,
        "learnt": law.is_learnt, "equation": equation_of(law), "parameters": parameters,
    }  # fmt: skip
