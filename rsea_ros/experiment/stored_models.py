"""Models and causes out of stored files: diagnosis.json and model.yaml."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rsea_ros.documents.strict_yaml import interval, mapping, number, text
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import FieldError, ParameterError
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis
from rsea_ros.experiment.joint_weighing import problem_of, vector_at, weights_of
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.unknowns import Unknown, clocks
from rsea_ros.model.rig import EffectSetting, Quantity, Rig
from rsea_ros.records.record import SENSED
from rsea_ros.records.statistics import Z95

SPREAD = 0.2
"""Relative, one sigma: the doubt of a cause's parameter whose file states no interval."""


@dataclass(frozen=True)
class ModelFile:
    """A cause in a rig. intervals: 95 %, of its parameters by name, SI. probability: None if unsaid."""

    name: str
    rig: Rig
    intervals: Mapping[str, tuple[float, float]]
    probability: float | None = None


def model_of(rig: Rig) -> ModelFile:
    """Return a model.yaml as a model: its last effect is the cause, the others belong to the rig."""
    name = rig.effects[-1].name if rig.effects else NOTHING
    return ModelFile(name, rig, {})


def hypotheses_from(models: Sequence[ModelFile]) -> list[Hypothesis]:
    """Return models as hypotheses; those without a probability share the rest equally.

    Raises ParameterError for two models of one name and for models of different machines.
    """
    names = [m.name for m in models]
    for name in names:
        if names.count(name) > 1:
            what = "without a cause" if name == NOTHING else f"with {name}"
            raise ParameterError(f"two models {what}, expected each cause once")
    built = [_construction(m.rig) for m in models]
    for theirs, model in zip(built[1:], models[1:], strict=True):
        for what, value in built[0].items():
            if value != theirs[what]:
                raise ParameterError(
                    f"models of different machines: {what} is {value} in {models[0].rig.name} and "
                    f"{theirs[what]} in {model.rig.name}, expected causes of one bench"
                )
    total = sum(m.probability or 0.0 for m in models)
    unstated = sum(m.probability is None for m in models)
    rest = max(1.0 - total, 0.05) / unstated if unstated else 0.0
    shares = np.array([rest if m.probability is None else m.probability for m in models])
    return [_hypothesis(m, float(p)) for m, p in zip(models, shares / shares.sum(), strict=True)]


def _construction(rig: Rig) -> dict[str, str]:
    """Return how a machine is built, in words: what the causes of one bench share."""
    ratio = rig.values().get("gear.ratio")
    sensors = [n for n in SENSED if rig.measures(n)]
    return {
        "the motion": "linear" if rig.linear else "rotary",
        "the gear ratio": "none" if ratio is None else f"{ratio:g}",
        "the spring": "rigid" if rig.rigid_spring else "compliant",
        "what is clamped": ", ".join(sorted(rig.clamped)) or "nothing",
        "the place of the sensors": f"{rig.ft_end}, {rig.encoder_end}",
        "what is measured": ", ".join(sensors) or "nothing",
        "the command": "a position" if rig.loop else "a torque",
    }


def _hypothesis(model: ModelFile, probability: float) -> Hypothesis:
    """Return a model as a hypothesis around its values."""
    rig = model.rig
    setting = next((e for e in rig.effects if e.name == model.name), None)
    bare = rig.with_effects(*(e for e in rig.effects if e is not setting))
    problem = problem_of(model.name, bare, ())
    problem = replace(problem, unknowns=(*problem.unknowns, *_clocks(problem, rig)))
    start = {f"{model.name}.{k}": v for k, v in (setting.parameters if setting else {}).items()}
    theta = vector_at(problem, {}, {**rig.values(), **start})
    sds = [_sd(u, float(x), rig, model) for u, x in zip(problem.unknowns, theta, strict=True)]
    known = weights_of(problem)
    information = np.diag(np.maximum(1.0 / np.array(sds) ** 2, known))
    return Hypothesis(model.name, problem, theta, information, probability)


def _clocks(problem: Problem, rig: Rig) -> tuple[Unknown, ...]:
    """Return the clocks of the sensors that a rig lists; a problem without records has none."""
    listed = [n for n in rig.sensors if rig.measures(n)]
    known = {u.name for u in problem.unknowns}
    return tuple(u for u in clocks(sorted(listed), rig) if u.name not in known)


def _sd(unknown: Unknown, coordinate: float, rig: Rig, model: ModelFile) -> float:
    """Return one sigma of an unknown in the fit's coordinates: of its interval, else as stated or SPREAD."""
    quantity = rig.quantities.get(unknown.name, Quantity(0.0))
    pair = quantity.ci95 or model.intervals.get(unknown.name)
    if pair is not None:
        ends = [unknown.inner(min(max(v, unknown.low), unknown.high) or 1e-12) for v in pair]
        return max((ends[1] - ends[0]) / (2.0 * Z95), 1e-6 * unknown.scale)
    if unknown.name.startswith(f"{model.name}."):
        return SPREAD if unknown.logarithmic else SPREAD * (abs(coordinate) or unknown.scale)
    return unknown.reach


def models_of(document: Mapping[str, Any], extended: Rig) -> list[ModelFile]:
    """Return the cause of a diagnosis that is most in doubt and its alternatives, each beside all other
    causes.

    extended: the diagnosis's model.yaml. Without a cause, the rig alone. Raises FieldError naming the field.
    """
    causes = [_cause(c, f"causes[{i}]", extended) for i, c in enumerate(_list(document, "causes"))]
    places = [(f"alternatives[{i}]", body) for i, body in enumerate(_list(document, "alternatives"))]
    others = [
        (text(body.get("instead_of", ""), f"{at}.instead_of"), _cause(body, at, extended))
        for at, body in places
    ]
    if not causes:
        return [ModelFile(NOTHING, extended, {})]
    doubt = {c.name: sum(m.probability or 0.0 for n, m in others if n == c.name) for c in causes}
    name = max(doubt, key=lambda n: (doubt[n], n == causes[-1].name))
    asked = next(c for c in causes if c.name == name)
    rest = tuple(e for e in extended.effects if e.name != name)
    group = [asked, *(m for n, m in others if n == name and m.name not in (e.name for e in rest))]
    return [replace(m, rig=extended.with_effects(*rest, m.rig.effects[-1])) for m in group]


def _cause(body: Mapping[str, Any], where: str, extended: Rig) -> ModelFile:
    name = text(body.get("name", ""), f"{where}.name")
    effect = effect_named(name)
    sizes = mapping(body.get("parameters", {}), f"{where}.parameters")
    values, intervals = {}, {}
    for p in effect.parameters:
        if p.name in sizes:
            entry = mapping(sizes[p.name], f"{where}.parameters.{p.name}")
            values[p.name] = number(entry.get("value"), f"{where}.parameters.{p.name}.value", p.unit)
            if entry.get("ci95"):
                place = f"{where}.parameters.{p.name}.ci95"
                intervals[f"{name}.{p.name}"] = interval(entry["ci95"], place, p.unit)
    setting = EffectSetting(name, {**effect.typical, **values})
    probability = number(body.get("probability", 1.0), f"{where}.probability", "1")
    if not 0.0 <= probability <= 1.0:
        raise FieldError(f"{where}.probability = {probability:g}, expected 0 to 1", f"{where}.probability")
    return ModelFile(name, extended.with_effects(setting), intervals, probability)


def _list(document: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    content = document.get(key, [])
    if not isinstance(content, list) or not all(isinstance(item, Mapping) for item in content):
        raise FieldError(f"{key}: expected a list of mappings as diagnosis.json has it", key)
    return content
