"""The causes that a diagnosis.json leaves possible, as models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rsea_ros.documents.fields import interval, mapping, number, text
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import FieldError
from rsea_ros.experiment.containment import NOTHING
from rsea_ros.experiment.stored_models import ModelFile
from rsea_ros.model.rig import EffectSetting, Rig


def models_of(document: Mapping[str, Any], extended: Rig) -> list[ModelFile]:
    """Return the cause of a diagnosis that is most in doubt and its alternatives, each beside all other
    causes.

    extended: the diagnosis's model.yaml. Without a cause, the rig alone. Raises FieldError naming the field.
    """
    causes = [_cause(c, f"causes[{i}]", extended) for i, c in enumerate(_list(document, "causes"))]
    others = [
        (
            text(a.get("instead_of", ""), f"alternatives[{i}].instead_of"),
            _cause(a, f"alternatives[{i}]", extended),
        )
        for i, a in enumerate(_list(document, "alternatives"))
    ]
    if not causes:
        return [ModelFile(NOTHING, extended, {})]
    doubt = {c.name: sum(m.probability or 0.0 for n, m in others if n == c.name) for c in causes}
    name = max(doubt, key=lambda n: (doubt[n], n == causes[-1].name))
    asked = next(c for c in causes if c.name == name)
    rest = tuple(e for e in extended.effects if e.name != name)
    group = [asked, *(m for n, m in others if n == name and m.name not in (e.name for e in rest))]
    return [_model_file(m, extended, rest) for m in group]


def _model_file(model: ModelFile, extended: Rig, rest: tuple[EffectSetting, ...]) -> ModelFile:
    return ModelFile(
        model.name, extended.with_effects(*rest, model.rig.effects[-1]), model.intervals, model.probability
    )


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
