"""diagnosis.json: a diagnosis for programs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rsea_ros.diagnosis.result import (
    Alternative,
    Cause,
    CauseParameter,
    Diagnosis,
    Experiment,
    Misfit,
    Rejected,
)
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.sentences import diagnosis_sentence, evidence, next_run
from rsea_ros.report.identification.json import parameter
from rsea_ros.report.json_values import fault_json, finite, numbers
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.rig.json import rig_json

SCHEMA = 1


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the contents of diagnosis.json; infinite numbers and NaN are null."""
    d = diagnosis
    return {
        "schema": SCHEMA,
        "rig": d.rig_name,
        **rig_json(d.rig_choice, d.remarks),
        "verdict": d.verdict,
        "channel": d.channel,
        "sentence": diagnosis_sentence(d),
        "data": {
            "bags": list(d.sources),
            "duration_s": finite(d.duration),
            "rate_hz": finite(d.rate),
            "faults": [fault_json(f) for f in d.faults],
        },
        "baseline": {
            "parameters": {p.name: parameter(p) for p in d.baseline},
            "residual_rms": numbers(d.residual_rms),
            "noise_rms": numbers(d.noise_rms),
            "fit_percent": numbers(d.fit_percent),
        },
        "misfit": [_misfit(m) for m in d.misfit],
        "causes": [_cause(c) for c in d.causes],
        "alternatives": [_alternative(a) for a in d.alternatives],
        "rejected": [_rejection(r) for r in d.rejected],
        "extended": {
            "parameters": {p.name: parameter(p) for p in d.final},
            "residual_rms": numbers(d.extended_residual_rms),
            "fit_percent": numbers(d.extended_fit_percent),
            "at_noise_floor": d.at_noise_floor,
            "misfit": [_misfit(m) for m in d.remaining],
        },
        "next_experiment": _experiment(d.next_experiment),
        "statements": list(remark_sentences(d.remarks)),
        "settings": _settings(d.settings),
        "noise_numbers": {s.name: s.value for s in d.settings.numbers() if s.name.startswith("noise.")},
    }


def _settings(settings: DiagnosisSettings) -> dict[str, Any]:
    """Return every number that steered the verdict, `group.name`: value."""
    values = ((s.name, s.value) for s in settings.numbers())
    numbers = {name: list(v) if isinstance(v, tuple) else v for name, v in values}
    return {"max_causes": settings.max_causes, "without": list(settings.without), **numbers}


def _misfit(m: Misfit) -> dict[str, Any]:
    return {
        "what": m.what,
        "from": finite(m.low),
        "to": finite(m.high),
        "unit": m.unit,
        "times_noise": finite(m.times_noise),
        "channel": m.channel,
    }


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "name": cause.name,
        "status": cause.status,
        "probability": finite(cause.probability),
        "channel": cause.channel,
        "parameters": _sizes(cause.parameters),
        "gain": {
            "train": finite(cause.gain_train),
            "holdout": finite(cause.gain_holdout),
            "holdout_ci95": _pair(cause.gain_holdout_ci95),
        },
        "evidence": evidence(cause),
        "equation": cause.equation,
        "confusable_with": list(cause.confusable_with),
    }


def _alternative(a: Alternative) -> dict[str, Any]:
    return {
        "name": a.name,
        "instead_of": a.instead_of,
        "probability": finite(a.probability),
        "channel": a.channel,
        "parameters": _sizes(a.parameters),
        "gain": {"holdout": finite(a.gain_holdout), "holdout_ci95": _pair(a.gain_holdout_ci95)},
    }


def _sizes(parameters: Mapping[str, CauseParameter]) -> dict[str, Any]:
    return {name: _estimate(p) for name, p in parameters.items()}


def _estimate(p: CauseParameter) -> dict[str, Any]:
    statistical = None if p.statistical_ci95 is None else _pair(p.statistical_ci95)
    return {
        "value": finite(p.value),
        "unit": p.unit,
        "ci95": _pair(p.ci95),
        "statistical_ci95": statistical,
        "model_sd": finite(p.model_sd),
    }


def _pair(interval: tuple[float, float]) -> list[float | None]:
    return [finite(side) for side in interval]


def _rejection(rejected: Rejected) -> dict[str, Any]:
    return {
        "name": rejected.name,
        "gain_holdout": finite(rejected.gain_holdout),
        "why": say.rejection(rejected),
        "reason": rejected.reason,
        "rival": rejected.rival or None,
        "fitted": rejected.is_fitted,
        "probability": rejected.probability,
    }


def _experiment(experiment: Experiment | None) -> dict[str, Any] | None:
    if experiment is None:
        return None
    return {"why": next_run(experiment), "excitation": _finite_values(experiment.excitation)}


def _finite_values(values: Mapping[str, float | str]) -> dict[str, float | str | None]:
    return {name: value if isinstance(value, str) else finite(value) for name, value in values.items()}
