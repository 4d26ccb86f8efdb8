"""Rigs in YAML: load with every key checked, save aside and rename.

A value is written `{value: 0.953, unit: kg m^2, spread: 0.3, source: Table 2}`; the unit must be the one of
`rig.FIELDS`. `model.yaml`, what identification and diagnosis write, is a rig file with an `effects` list.
"""

from __future__ import annotations

import math
import os
import sysconfig
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import yaml

from rsea_ros.errors import RigError
from rsea_ros.model.rig import (
    END_NAMES,
    FIELDS,
    Controller,
    EffectSetting,
    Field,
    Quantity,
    Rig,
    Sensor,
    check_value,
)
from rsea_ros.signals import UNITS

_GROUPS = sorted({name.split(".")[0] for name in FIELDS})
_TOP = {"name", "about", "source", "known", "proximal", "sensors", "controller", "effects", *_GROUPS}
_SWITCHES = {"gear": {"train"}, "spring": {"rigid"}, **{end: {"clamped"} for end in END_NAMES}}


def rig_path(name_or_path: str | Path) -> Path:
    """Return the file of a rig given by path or by the bare name of a file in config/rigs."""
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml") or path.exists():
        return path
    for folder in rig_folders():
        if (folder / f"{name_or_path}.yaml").exists():
            return folder / f"{name_or_path}.yaml"
    known = sorted({p.stem for folder in rig_folders() for p in folder.glob("*.yaml")})
    raise RigError(f"rig {str(name_or_path)!r} not found, expected a YAML file or one of {', '.join(known)}")


def rig_folders() -> list[Path]:
    """Return where rigs lie: beside the source, or in the share of the installed package."""
    here = Path(__file__).resolve()
    candidates = [
        here.parents[2] / "config" / "rigs",
        Path(sysconfig.get_path("data")) / "share/rsea_ros/config/rigs",
    ]
    candidates += [parent / "share/rsea_ros/config/rigs" for parent in here.parents[3:7]]
    return [folder for folder in candidates if folder.is_dir()]


def load_rig(name_or_path: str | Path) -> Rig:
    """Read a rig. Raises RigError naming file, field, value and what was expected."""
    path = rig_path(name_or_path)
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RigError(f"{path}: no such file, expected a rig in YAML") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise RigError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(document, Mapping):
        raise RigError(f"{path}: holds {type(document).__name__}, expected a mapping with the keys of a rig")
    try:
        return rig_from_document(document, default_name=path.stem)
    except RigError as error:
        raise RigError(f"{path}: {error}") from None


def rig_from_document(document: Mapping[str, Any], default_name: str = "rig") -> Rig:
    """Build a rig from the parsed YAML. Raises RigError naming the field."""
    _only_keys(document, _TOP, "rig")
    groups = {g: _mapping(document.get(g, {}), g) for g in _GROUPS}
    quantities = {name: q for g, body in groups.items() for name, q in _quantities(g, body)}
    clamped = frozenset(end for end in END_NAMES if _switch(groups[end], f"{end}.clamped"))
    effects = _effects(document.get("effects", []))
    return Rig(
        name=_text(document.get("name", default_name), "name"),
        about=_text(document.get("about", ""), "about"),
        source=_text(document.get("source", ""), "source"),
        quantities=quantities,
        clamped=clamped,
        rigid_spring=_switch(groups["spring"], "spring.rigid"),
        train=groups["gear"].get("train", "planetary"),
        sensors=_sensors(_mapping(document.get("sensors", {}), "sensors")),
        known=_known(
            document.get("known", []),
            [*quantities, *(f"{e.name}.{p}" for e in effects for p in e.parameters)],
        ),
        proximal=_text(document.get("proximal", "housing_end"), "proximal"),
        controller=_controller(document.get("controller")),
        effects=effects,
    )


def save_rig(rig: Rig, path: str | Path) -> None:
    """Write a rig as YAML that `load_rig` reads back to the same rig; aside first, then renamed."""
    path = Path(path)
    aside = path.with_name(path.name + ".partial")
    aside.write_text(
        yaml.safe_dump(rig_to_document(rig), sort_keys=False, allow_unicode=True), encoding="utf-8"
    )
    os.replace(aside, path)


def rig_to_document(rig: Rig) -> dict[str, Any]:
    """Return the rig as the mapping that its YAML file holds."""
    document: dict[str, Any] = {
        "name": rig.name,
        "about": rig.about,
        "source": rig.source,
        "proximal": rig.proximal,
    }
    for name, quantity in rig.quantities.items():
        group, key = name.split(".")
        document.setdefault(group, {})[key] = _quantity_to_document(name, quantity)
    for end in rig.clamped:
        document.setdefault(end, {})["clamped"] = True
    document.setdefault("gear", {})["train"] = rig.train
    if rig.rigid_spring:
        document.setdefault("spring", {})["rigid"] = True
    document["known"] = sorted(rig.known)
    document["sensors"] = {
        n: {"noise": s.noise, "quantum": s.quantum, "unit": UNITS[n]} for n, s in rig.sensors.items()
    }
    if rig.controller:
        document["controller"] = {
            "k_p": rig.controller.k_p,
            "k_v": rig.controller.k_v,
            "limit": rig.controller.limit,
        }
    document["effects"] = [
        {"name": e.name, "parameters": {k: float(v) for k, v in e.parameters.items()}} for e in rig.effects
    ]
    return document


def _quantity_to_document(name: str, quantity: Quantity) -> dict[str, Any]:
    body: dict[str, Any] = {"value": float(quantity.value), "unit": FIELDS[name].unit}
    if quantity.spread:
        body["spread"] = float(quantity.spread)
    if quantity.source:
        body["source"] = quantity.source
    if quantity.ci95:
        body["ci95"] = [float(v) for v in quantity.ci95]
    return body


def _quantities(group: str, body: Mapping[str, Any]) -> list[tuple[str, Quantity]]:
    switches = _SWITCHES.get(group, set())
    allowed = {name.split(".")[1] for name in FIELDS if name.startswith(group + ".")}
    _only_keys(body, allowed | switches, group)
    return [
        (f"{group}.{key}", _quantity(f"{group}.{key}", item))
        for key, item in body.items()
        if key not in switches
    ]


def _quantity(name: str, item: Any) -> Quantity:
    field: Field = FIELDS[name]
    body = _mapping(item, name, expected=f"{{value: …, unit: {field.unit}}}")
    _only_keys(body, {"value", "unit", "spread", "source", "ci95"}, name)
    if body.get("unit") != field.unit:
        raise RigError(f"{name}.unit = {body.get('unit')!r}, expected {field.unit!r}")
    value = number(body.get("value"), name, field.unit)
    check_value(name, value, where="value")
    spread = number(body.get("spread", 0.0), f"{name}.spread", "relative, one sigma")
    if not 0.0 <= spread < 10.0:
        raise RigError(f"{name}.spread = {spread:g}, expected a relative one-sigma spread from 0 to 10")
    ci95 = tuple(number(v, f"{name}.ci95", field.unit) for v in body["ci95"]) if body.get("ci95") else None
    return Quantity(value, spread, _text(body.get("source", ""), f"{name}.source"), ci95)  # type: ignore[arg-type]


def _sensors(body: Mapping[str, Any]) -> dict[str, Sensor]:
    _only_keys(body, set(UNITS), "sensors")
    sensors = {}
    for name, item in body.items():
        fields = _mapping(item, f"sensors.{name}")
        _only_keys(fields, {"noise", "quantum", "unit", "source"}, f"sensors.{name}")
        if fields.get("unit") != UNITS[name]:
            raise RigError(f"sensors.{name}.unit = {fields.get('unit')!r}, expected {UNITS[name]!r}")
        noise, quantum = (
            number(fields.get(k, 0.0), f"sensors.{name}.{k}", UNITS[name]) for k in ("noise", "quantum")
        )
        if not (0 <= noise < math.inf and 0 <= quantum < math.inf):
            raise RigError(
                f"sensors.{name} = {noise:g}, {quantum:g} {UNITS[name]}, expected finite values >= 0"
            )
        sensors[name] = Sensor(noise, quantum)
    return sensors


def _known(items: Any, stated: Collection[str]) -> frozenset[str]:
    if not isinstance(items, list):
        raise RigError(f"known = {items!r}, expected a list of field names")
    for item in items:
        if item not in stated:
            raise RigError(f"known: {item!r}, expected a value that this rig states: {', '.join(stated)}")
    return frozenset(items)


def _controller(item: Any) -> Controller | None:
    if item is None:
        return None
    body = _mapping(item, "controller")
    _only_keys(body, {"k_p", "k_v", "limit", "source"}, "controller")
    k_p = number(body.get("k_p"), "controller.k_p", "1/s")
    k_v = number(body.get("k_v"), "controller.k_v", "N m s/rad")
    return Controller(k_p, k_v, number(body.get("limit", math.inf), "controller.limit", "N m"))


def _effects(items: Any) -> tuple[EffectSetting, ...]:
    if not isinstance(items, list):
        raise RigError(f"effects = {items!r}, expected a list of {{name: …, parameters: {{…}}}}")
    settings = []
    for i, item in enumerate(items):
        body = _mapping(item, f"effects[{i}]")
        _only_keys(body, {"name", "parameters", "ci95"}, f"effects[{i}]")
        parameters = _mapping(body.get("parameters", {}), f"effects[{i}].parameters")
        values = {k: number(v, f"effects[{i}].{k}", "SI") for k, v in parameters.items()}
        settings.append(EffectSetting(_text(body.get("name", ""), f"effects[{i}].name"), values))
    return tuple(settings)


def number(value: Any, name: str, unit: str) -> float:
    """Return a YAML value as a float. Raises RigError when it is not a number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or math.isnan(value):
        raise RigError(f"{name} = {value!r}, expected a number ({unit})")
    return float(value)


def _switch(body: Mapping[str, Any], name: str) -> bool:
    value = body.get(name.split(".")[1], False)
    if not isinstance(value, bool):
        raise RigError(f"{name} = {value!r}, expected true or false")
    return value


def _text(value: Any, name: str) -> str:
    if not isinstance(value, str):
        raise RigError(f"{name} = {value!r}, expected text")
    return value


def _mapping(value: Any, name: str, expected: str = "a mapping") -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise RigError(f"{name} = {value!r}, expected {expected}")
    return value


def _only_keys(body: Mapping[str, Any], allowed: set[str], where: str) -> None:
    for key in body:
        if key not in allowed:
            raise RigError(f"{where}: unknown key {key!r}, expected one of {', '.join(sorted(allowed))}")
