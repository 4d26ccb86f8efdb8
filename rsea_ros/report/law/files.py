"""The files of a law: all of them or none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rsea_ros.effects.catalogue import lent
from rsea_ros.laws.equation import equation_of
from rsea_ros.laws.law import Law
from rsea_ros.laws.result import LawResult
from rsea_ros.model.rig_file import rig_text
from rsea_ros.new_files import NewFiles, Place
from rsea_ros.report.json_values import json_text, numbers, with_provenance
from rsea_ros.report.law.page import law_report
from rsea_ros.report.law.words import headline
from rsea_ros.report.provenance import Provenance

JSON, BASE, MODEL, REPORT = NAMES = ("law.json", "base.yaml", "model.yaml", "report.html")
SCHEMA = 1


def write_law(result: LawResult, out: Place | str | Path, provenance: Provenance | None = None) -> Path:
    """Write law.json, the effect files, base.yaml, model.yaml and report.html; return the report's path."""
    with NewFiles(out) as new, lent(*(w.effect for w in result.laws)):
        new.write(JSON, json_text(with_provenance(law_json(result), provenance)))
        for written in result.laws:
            new.write(f"{written.law.name}.py", written.source)
        new.write(BASE, rig_text(result.base_rig))
        new.write(MODEL, rig_text(result.rig))
        return new.write(REPORT, law_report(result, provenance))


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
