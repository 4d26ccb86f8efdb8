"""Import maps: which column of a foreign file is which channel, in which unit; docs/import.md has examples.

A list of terms is summed: `command: [{column: vir, unit: V, scale: 35.15}, {column: pulses, unit: N m}]`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from msg_adapters.tables import map_terms
from msg_adapters.tables.child import choose_element, is_open
from msg_adapters.tables.column_table import CHANNELS, LINEAR, unit
from msg_adapters.tables.map_terms import CHANNEL, MAP, RATES, RUNS, SET_POINTS, TIME, WHERE
from msg_adapters.tables.text_file import DELIMITERS
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import list_names, quote
from rsea_ros.errors import FieldError, ImportMapError


@dataclass(frozen=True)
class RowFilter:
    """Rows that count: start <= value of the column < stop, or value = equals."""

    column: str
    start: float | None = None
    stop: float | None = None
    equals: float | str | None = None


@dataclass(frozen=True)
class ImportMap:
    """A checked import map. time: the column of stamps and its gain to s; or rate, Hz."""

    path: Path
    channels: Mapping[str, tuple[map_terms.ChannelTerm, ...]]
    time: map_terms.ChannelTerm | None
    rate: float | None
    where: RowFilter | None = None
    delimiter: str | None = None
    about: str = ""
    runs: str | None = None
    header: bool | None = None
    decimal: str = "."
    set_points: bool = False

    @property
    def files(self) -> tuple[str, ...]:
        """The files of the directory that is read, one empty name where a file is read."""
        return tuple(dict.fromkeys(terms[0].file for terms in self.channels.values()))

    def at(self, index: int | None) -> ImportMap:
        """Return the map for one index into lists in cells. Raises ImportMapError where none is chosen."""
        channels = {
            name: tuple(term.at(index) for term in terms) for name, terms in self.channels.items()
        }
        where = self.where and replace(self.where, column=choose_element(self.where.column, index))
        columns = [t.column for terms in channels.values() for t in terms] + ([where.column] if where else [])
        left = [column for column in columns if is_open(column)]
        if left:
            raise ImportMapError(
                f"{self.path}: column {left[0]!r} holds several joints, expected the number of one, from 0 "
                "(--index)"
            )
        for name, terms in channels.items():
            for joints in [list(term.by_joint) for term in terms if term.by_joint]:
                asked = "no joint is chosen" if index is None else f"joint {index} is chosen"
                raise ImportMapError(
                    f"{self.path}: channels.{name} has a sign, scale or constant for each of the joints "
                    f"{list_names([str(joint) for joint in joints])}, and {asked}, expected --index with one "
                    "of them; a list counts from 0, {1: 4.2, 2: 3.1} states the numbers"
                )
        return replace(self, channels=channels, where=where)

    def of_file(self, file: str) -> ImportMap:
        """Return the map of the channels that a file holds."""
        held = {name: terms for name, terms in self.channels.items() if terms[0].file == file}
        return replace(self, channels=held)

    @property
    def labels(self) -> tuple[str, ...]:
        """The columns that choose rows."""
        return (*([self.where.column] if self.where else ()), *([self.runs] if self.runs else ()))

    def columns(self) -> list[str]:
        """Return every needed column, each once."""
        terms = [column for terms in self.channels.values() for term in terms for column in term.columns]
        return list(dict.fromkeys([*(self.time.columns if self.time else ()), *self.labels, *terms]))


def load_map(path: str | Path) -> ImportMap:
    """Read an import map. Raises ImportMapError with file, line, field, value and expectation."""
    path = Path(path)
    return strict_yaml.load(path, "an import map in YAML", ImportMapError, lambda held: _map(path, held))


_Channels = dict[str, tuple[map_terms.ChannelTerm, ...]]
_TEXT = {"header": None, "decimal": ".", "delimiter": None}
"""Keys of a text file, and their values where they are left out."""


def _map(path: Path, document: object) -> ImportMap:
    if isinstance(document, Mapping) and "channels" in document and "time" not in document:
        expected = f"a column with its unit, `{{rate: 1000}}` Hz, or `{SET_POINTS}` for readings at rest"
        raise FieldError(f"map: no 'time', expected {expected}", "map")
    body = map_terms.checked_keys(document, "map", MAP)
    set_points = body["time"] == SET_POINTS
    time = map_terms.checked_keys({"rate": 1.0} if set_points else body["time"], "time", TIME)
    if ("rate" in time) == ("column" in time or "expression" in time):
        raise FieldError("time: expected either a column with its unit, or a rate in Hz", "time")
    rate = map_terms.number(time["rate"], "time.rate") if "rate" in time else None
    if rate is not None and not RATES[0] <= rate <= RATES[1]:
        expected = f"more than 0 Hz: {RATES[0]:g} to {RATES[1]:g} Hz"
        raise FieldError(f"time.rate is {rate}, expected {expected}", "time.rate")
    for name in body["channels"] if isinstance(body["channels"], Mapping) else ():
        if name not in CHANNELS and re.search(r"curr|amp|^i_?q|effort|torque", str(name), re.IGNORECASE):
            raise FieldError(
                f"channels: no {quote(name)}: map it as `command` if it was commanded, as `motor_torque` if"
                " measured; a current with `scale:`, N·m for each A",
                f"channels.{name}",
            )
    channels = map_terms.checked_keys(body["channels"], "channels", CHANNEL)
    runs = map_terms.checked_keys(body["runs"], "runs", RUNS)["column"] if "runs" in body else None
    header, decimal, delimiter = (body.get(k, v) for k, v in _TEXT.items())
    map_terms.expect(header, "header", header is None or isinstance(header, bool), "true or false")
    map_terms.expect(decimal, "decimal", decimal in (".", ","), "'.' or ','")
    known = delimiter is None or (isinstance(delimiter, str) and delimiter in DELIMITERS)
    map_terms.expect(delimiter, "delimiter", known, f"one of {', '.join(map(repr, DELIMITERS))}")
    return ImportMap(
        path=path,
        channels=_one_kind({name: map_terms.terms_of(name, value) for name, value in channels.items()}),
        time=None if rate else map_terms.term_of("time", time, "time"),
        rate=rate,
        where=_rows(body["where"]) if "where" in body else None,
        delimiter=delimiter and DELIMITERS[delimiter],
        runs=None if runs is None else map_terms.column_name(runs, "runs.column"),
        header=header,
        decimal=decimal,
        set_points=set_points,
        about=" ".join(str(body.get("about", "")).split()),
    )


def _one_kind(channels: _Channels) -> _Channels:
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


def _rows(value: object) -> RowFilter:
    body = map_terms.checked_keys(value, "where", WHERE)
    limits = {key: map_terms.number(body[key], f"where.{key}") for key in ("from", "below") if key in body}
    equals = body.get("equals")
    if not limits and equals is None:
        raise FieldError("where: expected one of from, below, equals", "where")
    if equals is not None and not isinstance(equals, str):
        equals = map_terms.number(equals, "where.equals")
    column = map_terms.column_name(body["column"], "where.column")
    return RowFilter(column, limits.get("from"), limits.get("below"), equals)
