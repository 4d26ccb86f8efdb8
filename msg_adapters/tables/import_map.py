"""Import maps: which column of a foreign file is which channel, and in which unit.

about: one line that goes into the bag's notes
time: {column: t, unit: s}                    # or {rate: 1000} (Hz) where the file has no time
where: {column: test_nr, below: 100}          # optional: only these rows; also from:, equals:
delimiter: ";"                                # optional: text files only, else by the file's name
channels:
  position: {column: phi, unit: deg, sign: -1}
  command:                                    # a list is summed
    - {column: vir, unit: V, scale: 35.15}    # N m for each V
    - {column: pulses, unit: N m, constant: 0.5}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from msg_adapters.tables.units import CHANNELS, LINEAR, unit
from rsea_ros.errors import ImportMapError


@dataclass(frozen=True)
class Term:
    """A column's part in a channel, in SI: sign · scale · column · (SI factor of its unit) + constant."""

    column: str
    unit: str
    gain: float
    constant: float = 0.0


@dataclass(frozen=True)
class Rows:
    """Rows that count: start <= value of the column < stop, or value = equals."""

    column: str
    start: float | None = None
    stop: float | None = None
    equals: float | None = None


@dataclass(frozen=True)
class ImportMap:
    """A checked import map. time: the column of stamps and its gain to s; or rate, Hz."""

    path: Path
    channels: Mapping[str, tuple[Term, ...]]
    time: Term | None
    rate: float | None
    where: Rows | None = None
    delimiter: str | None = None
    about: str = ""

    def columns(self) -> list[str]:
        """Return every column that is needed, each once."""
        terms = [term.column for terms in self.channels.values() for term in terms]
        extra = [part.column for part in (self.time, self.where) if part is not None]
        return list(dict.fromkeys(extra + terms))


def load_map(path: str | Path) -> ImportMap:
    """Read an import map. Raises ImportMapError with file, field, value and expectation."""
    try:
        document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror}, expected an import map in YAML") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ImportMapError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    try:
        return _map(Path(path), document)
    except ValueError as error:
        raise ImportMapError(f"{path}: {error}") from None


def _map(path: Path, document: object) -> ImportMap:
    body = _keys(document, "map", {"about", "time", "where", "delimiter", "channels"}, {"time", "channels"})
    time = _keys(body["time"], "time", {"column", "unit", "rate"}, set())
    if ("rate" in time) == ("column" in time):
        raise ValueError("time: expected either a column with its unit, or a rate in Hz")
    rate = _number(time["rate"], "time.rate") if "rate" in time else None
    if rate is not None and rate <= 0:
        raise ValueError(f"time.rate is {rate}, expected more than 0 Hz")
    channels = _keys(body["channels"], "channels", set(CHANNELS), set())
    return ImportMap(
        path=path,
        channels=_one_kind({name: _terms(name, value) for name, value in channels.items()}),
        time=None if rate else _term("time", time, "time"),
        rate=rate,
        where=_rows(body["where"]) if "where" in body else None,
        delimiter=str(body["delimiter"]) if "delimiter" in body else None,
        about=" ".join(str(body.get("about", "")).split()),
    )


def _terms(channel: str, value: object) -> tuple[Term, ...]:
    parts = value if isinstance(value, list) else [value]
    fields = [f"channels.{channel}" + (f"[{i}]" if value is parts else "") for i in range(len(parts))]
    return tuple(_term(field, part, CHANNELS[channel]) for field, part in zip(fields, parts, strict=True))


def _term(field: str, value: object, dimension: str) -> Term:
    """Return a term. A unit of another dimension than the channel's needs a scale that converts it."""
    body = _keys(value, field, {"column", "unit", "sign", "scale", "constant"}, {"column", "unit"})
    found, factor = unit(body["unit"])
    if LINEAR.get(found, found) != dimension and "scale" not in body:
        raise ValueError(
            f"{field}: unit {body['unit']!r} is a {found}, expected a {dimension}, or a scale to it"
        )
    sign = _number(body.get("sign", 1), f"{field}.sign")
    if sign not in (1, -1):
        raise ValueError(f"{field}.sign is {sign}, expected 1 or -1")
    gain = sign * factor * _number(body.get("scale", 1), f"{field}.scale")
    return Term(
        str(body["column"]), str(body["unit"]), gain, _number(body.get("constant", 0), f"{field}.constant")
    )


def _one_kind(channels: dict[str, tuple[Term, ...]]) -> dict[str, tuple[Term, ...]]:
    """Refuse a map without channels, and one that mixes a linear with a rotary machine."""
    if not channels:
        raise ValueError(f"channels is empty, expected some of {', '.join(CHANNELS)}")
    terms = [term for terms in channels.values() for term in terms]
    dimensions = {unit(term.unit)[0]: term.unit for term in terms}
    linear = [name for dimension, name in dimensions.items() if dimension in LINEAR]
    rotary = [name for dimension, name in dimensions.items() if dimension in LINEAR.values()]
    if linear and rotary:
        raise ValueError(
            f"channels mix {linear[0]!r} and {rotary[0]!r}, expected a linear or a rotary machine"
        )
    return channels


def _rows(value: object) -> Rows:
    body = _keys(value, "where", {"column", "from", "below", "equals"}, {"column"})
    limits = {key: _number(body[key], f"where.{key}") for key in ("from", "below", "equals") if key in body}
    if not limits:
        raise ValueError("where: expected one of from, below, equals")
    return Rows(str(body["column"]), limits.get("from"), limits.get("below"), limits.get("equals"))


def _keys(value: object, field: str, allowed: set[str], needed: set[str]) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{field} is {value!r}, expected a mapping with {', '.join(sorted(allowed))}")
    unknown = [str(key) for key in value if key not in allowed]
    if unknown:
        raise ValueError(f"{field}: unknown key {unknown[0]!r}, expected {', '.join(sorted(allowed))}")
    missing = sorted(needed - set(value))
    if missing:
        raise ValueError(f"{field}: no {missing[0]!r}, expected {', '.join(sorted(needed))}")
    return value


def _number(value: object, field: str) -> float:
    try:
        return float(str(value))
    except ValueError:
        raise ValueError(f"{field} is {value!r}, expected a number") from None
