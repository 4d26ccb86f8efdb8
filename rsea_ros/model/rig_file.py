"""Rig files: found by name, read, and written.

`model.yaml`, written by identification and diagnosis, is a rig file with an `effects` list.
"""

import os
import sysconfig
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import OutputError, RigError, RseaError
from rsea_ros.model.rig import CLOCK_DOUBT, FIELDS, Condition, Quantity, Rig, Sensor
from rsea_ros.model.rig_document import rig_from_document, with_conditions
from rsea_ros.model.sensor_filter import KINDS
from rsea_ros.records.record import UNITS


def rig_to_document(rig: Rig) -> dict[str, Any]:
    """Return the rig as the mapping that its YAML file holds."""
    document: dict[str, Any] = {n: getattr(rig, n) for n in ("name", "about", "source", "proximal")}
    rare = ("linear", "ft_end", "encoder_end", "beside_spring", "motion")
    document |= {key: getattr(rig, key) for key in rare if getattr(rig, key) != getattr(Rig, key)}
    if rig.loop:
        document["controller"] = {"kind": rig.loop}
    if rig.hold != "zero":
        document["hold"] = rig.hold
    for name, quantity in rig.quantities.items():
        group, key = name.split(".")
        document.setdefault(group, {})[key] = _quantity_to_document(name, quantity)
    for end in sorted(rig.clamped):
        document.setdefault(end, {})["clamped"] = True
    document.setdefault("gear", {})["train"] = rig.train
    if rig.other_trains:
        document["gear"]["or"] = list(rig.other_trains)
    if rig.rigid_spring:
        document.setdefault("spring", {})["rigid"] = True
    document["known"] = sorted(rig.known)
    document["sensors"] = {n: _sensor_to_document(n, s) for n, s in rig.sensors.items()}
    if rig.controller:
        document["controller"] = {key: getattr(rig.controller, key) for key in ("k_p", "k_v", "limit")}
    document["effects"] = [
        {
            "name": e.name,
            "parameters": {k: float(v) for k, v in e.parameters.items()},
            **({"guess": True} if e.guess else {}),
        }
        for e in rig.effects
    ]
    if rig.conditions:
        document["conditions"] = [_condition_to_document(c) for c in rig.conditions]
    return document


def _condition_to_document(c: Condition) -> dict[str, Any]:
    values = {n: _quantity_to_document(n, q) for n, q in c.values.items()}
    added = {n: _quantity_to_document(n, Quantity(v)) for n, v in c.added.items()}
    body = {"values": values, "added": added, "without": sorted(c.without)}
    return {"record": c.record, **{key: item for key, item in body.items() if item}}


def _sensor_to_document(name: str, sensor: Sensor) -> dict[str, Any]:
    body: dict[str, Any] = {"noise": sensor.noise, "quantum": sensor.quantum, "unit": UNITS[name]}
    doubt = {"doubt": sensor.clock_doubt} if sensor.clock_doubt != CLOCK_DOUBT else {}
    body |= {"zero_unknown": True} if sensor.zero_unknown else {}
    body |= {"clock": {"value": sensor.clock, "unit": "s", **doubt}} if sensor.clock or doubt else {}
    body |= {"delay": {"value": sensor.delay, "unit": "s"}} if sensor.delay else {}
    if known := sensor.filter:
        stated = zip(KINDS[known.kind].items(), known.numbers, strict=True)
        numbers = {key: {"value": value, "unit": unit} for (key, (unit, *_)), value in stated}
        body["filter"] = {"kind": known.kind, **numbers}
    return body | ({"clock_rate": {"value": sensor.clock_rate, "unit": "ppm"}} if sensor.clock_rate else {})


def _quantity_to_document(name: str, quantity: Quantity) -> dict[str, Any]:
    interval = [float(v) for v in quantity.ci95 or ()]
    more = {"spread": float(quantity.spread), "source": quantity.source, "ci95": interval}
    return {"value": float(quantity.value), "unit": FIELDS[name].unit} | {k: v for k, v in more.items() if v}


def rig_path(name_or_path: str | Path) -> Path:
    """Return the file of a rig given by path or by the bare name of a file in config/rigs.

    Raises RigError for a name that no rig has, and for text that cannot be a file name.
    """
    if not isinstance(name_or_path, (str, os.PathLike)) or "\0" in str(name_or_path):
        raise RigError(f"rig {quote(name_or_path)}: expected the name of a rig, or of a YAML file")
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml") or path.is_file():
        return path
    return packaged("rig", str(name_or_path), "rigs", RigError)


def packaged(what: str, name: str, kind: str, error: type[RseaError]) -> Path:
    """Return the file NAME.yaml in config/KIND. Raises the error for a name that none has."""
    for folder in rig_folders():
        if (file := folder.parent / kind / f"{name}.yaml").exists():
            return file
    known = packaged_names(kind)
    expected = f"a YAML file or one of {', '.join(known)}{did_you_mean(name, known)}"
    raise error(f"{what} {name!r} not found, expected {expected}")


def packaged_names(kind: str = "rigs") -> list[str]:
    """Return the names of the files in config/KIND that come with the package."""
    return sorted({p.stem for folder in rig_folders() for p in (folder.parent / kind).glob("*.yaml")})


@cache
def rig_folders() -> tuple[Path, ...]:
    """Return where rigs lie: beside the source, or in the share of the installed package."""
    parents = Path(__file__).resolve().parents
    shares = (Path(sysconfig.get_path("data")), *parents[3:7])
    candidates = [parents[2] / "config" / "rigs", *(s / "share/rsea_ros/config/rigs" for s in shares)]
    return tuple(folder for folder in candidates if folder.is_dir())


def load_rig(name_or_path: str | Path | Rig) -> Rig:
    """Return the rig of a YAML file, or of a name in config/rigs; a Rig is returned unchanged.

    Raises RigError with file, field, value and expected value. Format: docs/rig.md.
    """
    if isinstance(name_or_path, Rig):
        return name_or_path
    path = rig_path(name_or_path)

    def build(content: Any) -> Rig:
        if not isinstance(content, Mapping):
            held = "nothing" if content is None else type(content).__name__
            raise RigError(f"holds {held}, expected a mapping with the keys of a rig")
        return rig_from_document(content, default_name=path.stem)

    return strict_yaml.load(path, "a rig in YAML that can be read", RigError, build)


def load_conditions(path: str | Path, rig: Rig, records: Collection[str]) -> Rig:
    """Return a rig with the conditions of a file in place of its own. records: names that there are.

    Raises RigError with file, line, field, value and expected value. Format: docs/rig.md.
    """

    def build(content: Any) -> Rig:
        body = strict_yaml.mapping(content, "file", "a mapping with the key conditions")
        strict_yaml.only_keys(body, {"conditions"}, "file")
        return with_conditions(rig, body.get("conditions"), records)

    return strict_yaml.load(Path(path), "a list of conditions in YAML that can be read", RigError, build)


def save_rig(rig: Rig, path: str | Path, *, force: bool = False) -> None:
    """Write a rig as YAML that `load_rig` reads back to the same rig; `force`: over a file that has the name.

    Raises RigError, and leaves nothing behind, when it cannot be written.
    """
    from rsea_ros.outputs.files import write_file  # a rig that is only read needs no writer

    try:
        write_file(path, rig_text(rig), force=force)
    except OutputError as error:
        raise RigError(str(error)) from None
    except OSError as error:
        raise RigError(f"{path}: {error.strerror}, expected a place that can be written") from None


def rig_text(rig: Rig) -> str:
    """Return the YAML of a rig."""
    return strict_yaml.dump(rig_to_document(rig))


@dataclass(frozen=True)
class RigChoice:
    """option: the rig as it was named, empty if a Rig was passed. is_default: the user named none.

    topics, part: options of the call, such as --joint elbow, that say which topics and which part of the
    record were read; a command on the same bags needs them too. conditions: file of --conditions, or empty.
    """

    option: str = ""
    is_default: bool = False
    topics: tuple[str, ...] = ()
    part: tuple[str, ...] = ()
    conditions: str = ""
