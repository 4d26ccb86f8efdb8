"""Import maps: which column of a foreign file is which channel, and in which unit.

about: one line that goes into the bag's notes
time: {column: t, unit: s}                    # or {rate: 1000} (Hz) where the file has no time
where: {column: test_nr, below: 100}          # optional: only these rows; also from:, equals:
delimiter: ";"                                # optional: text files only, else seen from the first line
channels:
  position: {column: phi, unit: deg, sign: -1}
  velocity: {file: states.csv, column: "rates[2]", unit: rad/s}   # of a file in the directory that is read
  command:                                    # a list is summed
    - {column: vir, unit: V, scale: 35.15}    # N m for each V
    - {column: pulses, unit: N m, constant: 0.5}
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from msg_adapters.tables.elements import CHOSEN, chosen
from msg_adapters.tables.keys import CHANNEL, MAP, RATES, TERM, TIME, WHERE
from msg_adapters.tables.layout import DELIMITERS
from msg_adapters.tables.units import CHANNELS, LINEAR, unit
from rsea_ros import strict_yaml
from rsea_ros.errors import FieldError, ImportMapError
from rsea_ros.keys import NEEDED, Key
from rsea_ros.wording import shown

LARGEST = 1e300
"""Of the numbers in a map: products of two of them and a unit stay finite."""


@dataclass(frozen=True)
class Term:
    """A column's part in a channel, in SI: sign · scale · column · (SI factor of its unit) + constant.

    file: in the directory that is read; empty for the one file that is.
    """

    column: str
    unit: str
    gain: float
    constant: float = 0.0
    file: str = ""


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

    @property
    def files(self) -> tuple[str, ...]:
        """The files of the directory that is read, one empty name where a file is read."""
        return tuple(dict.fromkeys(terms[0].file for terms in self.channels.values()))

    def at(self, index: int | None) -> ImportMap:
        """Return the map for one number of lists in cells. Raises ImportMapError where none is chosen."""
        channels = {
            name: tuple(replace(term, column=chosen(term.column, index)) for term in terms)
            for name, terms in self.channels.items()
        }
        left = [t.column for terms in channels.values() for t in terms if t.column.endswith(f"[{CHOSEN}]")]
        if left:
            raise ImportMapError(
                f"{self.path}: column {left[0]!r} holds several joints, expected the number of one, from 0 "
                "(--index)"
            )
        return replace(self, channels=channels)

    def of_file(self, file: str) -> ImportMap:
        """Return the map of the channels that a file holds."""
        held = {name: terms for name, terms in self.channels.items() if terms[0].file == file}
        return replace(self, channels=held)

    def columns(self) -> list[str]:
        """Return every column that is needed, each once."""
        terms = [term.column for terms in self.channels.values() for term in terms]
        extra = [part.column for part in (self.time, self.where) if part is not None]
        return list(dict.fromkeys(extra + terms))


def load_map(path: str | Path) -> ImportMap:
    """Read an import map. Raises ImportMapError with file, line, field, value and expectation."""
    try:
        document = strict_yaml.read(Path(path))
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror}, expected an import map in YAML") from None
    except FieldError as error:
        raise ImportMapError(f"{path}: {error}") from None
    try:
        return _map(Path(path), document.content)
    except FieldError as error:
        raise ImportMapError(f"{path}: {document.where(error.field)}{error}", error.field) from None


def _map(path: Path, document: object) -> ImportMap:
    body = _keys(document, "map", MAP)
    time = _keys(body["time"], "time", TIME)
    if ("rate" in time) == ("column" in time):
        raise FieldError("time: expected either a column with its unit, or a rate in Hz", "time")
    rate = _rate(time["rate"]) if "rate" in time else None
    channels = _keys(body["channels"], "channels", CHANNEL)
    return ImportMap(
        path=path,
        channels=_one_kind({name: _terms(name, value) for name, value in channels.items()}),
        time=None if rate else _term("time", time, "time"),
        rate=rate,
        where=_rows(body["where"]) if "where" in body else None,
        delimiter=_delimiter(body.get("delimiter")),
        about=" ".join(str(body.get("about", "")).split()),
    )


def _rate(value: object) -> float:
    rate = _number(value, "time.rate")
    if not RATES[0] <= rate <= RATES[1]:
        raise FieldError(
            f"time.rate is {rate}, expected more than 0 Hz: {RATES[0]:g} to {RATES[1]:g} Hz", "time.rate"
        )
    return rate


def _terms(channel: str, value: object) -> tuple[Term, ...]:
    parts = value if isinstance(value, list) else [value]
    if not parts:
        raise FieldError(
            f"channels.{channel} is an empty list, expected a column or more", f"channels.{channel}"
        )
    fields = [f"channels.{channel}" + (f"[{i}]" if value is parts else "") for i in range(len(parts))]
    terms = tuple(_term(field, part, CHANNELS[channel]) for field, part in zip(fields, parts, strict=True))
    if len({term.file for term in terms}) > 1:
        raise FieldError(
            f"channels.{channel} sums columns of several files, expected one file", f"channels.{channel}"
        )
    return terms


def _term(field: str, value: object, dimension: str) -> Term:
    """Return a term. A unit of another dimension than the channel's needs a scale that converts it."""
    body = _keys(value, field, TERM)
    try:
        found, factor = unit(body["unit"])
    except ValueError as error:
        raise FieldError(f"{field}: {error}", f"{field}.unit") from None
    if LINEAR.get(found, found) != dimension and "scale" not in body:
        raise FieldError(
            f"{field}: unit {body['unit']!r} is a {found}, expected a {dimension}, or a scale to it",
            f"{field}.unit",
        )
    sign = _number(body.get("sign", 1), f"{field}.sign")
    if sign not in (1, -1):
        raise FieldError(f"{field}.sign is {sign}, expected 1 or -1", f"{field}.sign")
    scale = _number(body.get("scale", 1), f"{field}.scale")
    if scale == 0.0:
        raise FieldError(
            f"{field}.scale is 0, expected another number: the channel would be lost", f"{field}.scale"
        )
    gain = sign * factor * scale
    column, constant = _column(body["column"], f"{field}.column"), body.get("constant", 0)
    file = _file(body.get("file", ""), f"{field}.file")
    return Term(column, str(body["unit"]), gain, _number(constant, f"{field}.constant"), file)


def _one_kind(channels: dict[str, tuple[Term, ...]]) -> dict[str, tuple[Term, ...]]:
    """Refuse a map without channels, and one that mixes a linear with a rotary machine."""
    if not channels:
        raise FieldError(f"channels is empty, expected some of {', '.join(CHANNELS)}", "channels")
    terms = [term for terms in channels.values() for term in terms]
    dimensions = {unit(term.unit)[0]: term.unit for term in terms}
    linear = [name for dimension, name in dimensions.items() if dimension in LINEAR]
    rotary = [name for dimension, name in dimensions.items() if dimension in LINEAR.values()]
    if linear and rotary:
        raise FieldError(
            f"channels mix {linear[0]!r} and {rotary[0]!r}, expected a linear or a rotary machine", "channels"
        )
    return channels


def _rows(value: object) -> Rows:
    body = _keys(value, "where", WHERE)
    limits = {key: _number(body[key], f"where.{key}") for key in ("from", "below", "equals") if key in body}
    if not limits:
        raise FieldError("where: expected one of from, below, equals", "where")
    return Rows(
        _column(body["column"], "where.column"), limits.get("from"), limits.get("below"), limits.get("equals")
    )


def _number(value: object, field: str) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < LARGEST:
        return float(value)
    raise FieldError(f"{field} is {shown(value)}, expected a number", field)


def _column(value: object, field: str) -> str:
    """Return the name of a column, or its number."""
    if isinstance(value, (str, int)) and not isinstance(value, bool):
        return str(value).strip()
    raise FieldError(f"{field} is {shown(value)}, expected a name; put quotes around it", field)


def _file(value: object, field: str) -> str:
    """Return the plain name of a file."""
    if isinstance(value, str) and value == Path(value).name:
        return value
    raise FieldError(f"{field} is {shown(value)}, expected the name of a file in the directory", field)


def _delimiter(value: object) -> str | None:
    if value is None or (isinstance(value, str) and value in DELIMITERS):
        return None if value is None else DELIMITERS[value]
    known = ", ".join(repr(key) for key in DELIMITERS)
    raise FieldError(f"delimiter is {shown(value)}, expected one of {known}", "delimiter")


def _keys(value: object, field: str, keys: Sequence[Key]) -> Mapping[str, Any]:
    """Return a mapping that has only these keys, and all of them that are needed."""
    allowed = ", ".join(sorted(key.name for key in keys))
    if not isinstance(value, Mapping):
        held = "empty" if value is None else shown(value)
        raise FieldError(f"{field} is {held}, expected a mapping with {allowed}", field)
    for name in value:
        if name not in [key.name for key in keys]:
            raise FieldError(f"{field}: unknown key {shown(name)}, expected {allowed}", f"{field}.{name}")
    needed = sorted(key.name for key in keys if key.default == NEEDED)
    for name in needed:
        if name not in value:
            raise FieldError(f"{field}: no {name!r}, expected {', '.join(needed)}", field)
    return value
