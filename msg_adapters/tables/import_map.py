"""Import maps: which column of a foreign file is which channel, in which unit; docs/import.md has examples.

A list of terms is summed: `command: [{column: vir, unit: V, scale: 35.15}, {column: pulses, unit: N m}]`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from msg_adapters.tables.column_table import CHANNELS, FACTORS, LINEAR, choose_element, is_open, unit
from msg_adapters.tables.expression import Expression, parse
from msg_adapters.tables.text_file import DELIMITERS
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.strict_yaml import NEEDED, Key
from rsea_ros.documents.wording import list_names, quote
from rsea_ros.errors import FieldError, ImportMapError

RATES = (1e-3, 1e6)
"""Hz, of a file without stamps."""

SET_POINTS = "set_points"
"""In place of a time: a table of readings at rest."""

MAP = (
    Key("about", "text", "empty", "one line for the notes of the bag"),
    Key("time", f"mapping, `{SET_POINTS}`", NEEDED, "source of the stamps: a column and its unit, or a rate"),
    Key("where", "mapping", "all rows", "condition on the rows that are used"),
    Key("runs", "mapping", "one run", "splits a file into runs by the values of a column, one bag for each"),
    Key("header", "`true`, `false`", "detected", "whether a text file begins with column names"),
    Key(
        "delimiter",
        "`,` `;` `|` `tab` `blanks`",
        "detected from the first line",
        "separator of the cells of a text file; `blanks`: one or more blanks or tabs",
    ),
    Key("decimal", "`.` `,`", "`.`", "decimal sign of a text file: `1,5` is 1.5 where it is a comma"),
    Key("channels", "mapping", NEEDED, "for each channel a column, or a list of columns to add"),
)
TIME = (
    Key("column", "name or number of a column", "a rate", "increasing stamps, in each file"),
    Key("expression", "expression", "a column", "computed from columns, in place of one column"),
    Key("unit", "unit of time", "required without `rate`", "unit of the stamps"),
    Key("rate", f"{RATES[0]:g} to {RATES[1]:g} Hz", "a column", "sample rate of a file without stamps"),
)
RUNS = (
    Key("column", "name or number of a column", NEEDED, "the column that numbers or names the runs"),
)
WHERE = (
    Key("column", "name or number of a column", NEEDED, "the column to compare"),
    Key("from", "number, as in the file", "no limit", "keeps rows with this value or more"),
    Key("below", "number, as in the file", "no limit", "keeps rows with less than this value"),
    Key("equals", "number or text", "no limit", "keeps rows with exactly this value"),
)
TERM = (
    Key("column", "name or number of a column", "an expression", "values; `q[2]`: one of several in a cell"),
    Key("expression", "expression", "a column", "computed from columns, in place of one column"),
    Key("file", "name of a file", "FILE itself", "the file that holds the column, in the directory FILE"),
    Key("unit", "unit", NEEDED, "unit of the column; another dimension needs a scale"),
    Key("sign", "1 or -1, or one each joint", "1", "-1 reverses the axis; `[1, -1]`, `{2: -1}`: by joint"),
    Key("scale", "not 0, or one each joint", "1", "SI units of the channel per SI unit of the column"),
    Key("constant", "number, or one each joint, SI unit", "0", "added after scale and sign"),
    Key("held", "`true`, `false`", "false", "rows repeat a value until the next one arrives: keep the first"),
)
CHANNEL = tuple(Key(name, dimension, "not measured") for name, dimension in CHANNELS.items())
PER_JOINT = {"sign": 1, "scale": 1, "constant": 0}
"""Keys that may have a number for each joint, and their values where they are left out."""
LARGEST = 1e300
"""Of the numbers in a map: products of two of them and a unit stay finite."""


@dataclass(frozen=True)
class ChannelTerm:
    """A part of a channel, in SI: sign · scale · column · (SI factor of its unit) + constant.

    expression: of columns, in the place of the column. file: in the directory that is read; empty for the one
    file that is. held: the log repeats a value until the next one arrives. by_joint: gain and constant by the
    number of the joint, where the map has several of them and none is chosen yet.
    """

    column: str
    unit: str
    gain: float
    constant: float = 0.0
    file: str = ""
    expression: Expression | None = None
    held: bool = False
    by_joint: Mapping[int, tuple[float, float]] = field(default_factory=dict)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that it needs."""
        return (self.column,) if self.expression is None else self.expression.columns

    def at(self, index: int | None) -> ChannelTerm:
        """Return the term for one number of lists in cells, and in the map."""
        term = self
        if index is not None and index in self.by_joint:
            gain, constant = self.by_joint[index]
            term = replace(self, gain=gain, constant=constant, by_joint={})
        if term.expression is None:
            return replace(term, column=choose_element(term.column, index))
        text = choose_element(term.expression.text, index)
        return replace(term, column=text, expression=parse(text))


def terms_of(channel: str, value: object) -> tuple[ChannelTerm, ...]:
    parts, where = value if isinstance(value, list) else [value], f"channels.{channel}"
    if not parts:
        raise FieldError(f"{where} is an empty list, expected a column or more", where)
    fields = [where + (f"[{i}]" if value is parts else "") for i in range(len(parts))]
    terms = tuple(term_of(field, part, CHANNELS[channel]) for field, part in zip(fields, parts, strict=True))
    if len({term.file for term in terms}) > 1:
        raise FieldError(f"{where} sums columns of several files, expected one file", where)
    return terms


def term_of(where: str, value: object, dimension: str) -> ChannelTerm:
    """Return a term. A unit of another dimension than the channel's needs a scale that converts it."""
    if isinstance(value, Mapping) and "unit" not in value:
        units = list(FACTORS[dimension])
        scaled = "" if dimension == "time" else ", or unit: 1 with a scale to SI units"
        raise FieldError(
            f"{where}: no unit, expected `unit: {units[0]}`, or {list_names(units[1:], 'or')} in its place"
            f"{scaled}; the file does not state it",
            where,
        )
    body = checked_keys(value, where, TERM)
    try:
        stated_dimension, factor = unit(body["unit"])
    except ValueError as error:
        raise FieldError(f"{where}: {error}", f"{where}.unit") from None
    if LINEAR.get(stated_dimension, stated_dimension) != dimension and "scale" not in body:
        mismatch = f"unit {body['unit']!r} is a {stated_dimension}, expected a {dimension}, or a scale to it"
        raise FieldError(f"{where}: {mismatch}", f"{where}.unit")
    expression = _expression(body, where)
    column = expression.text if expression else column_name(body["column"], f"{where}.column")
    file, held = body.get("file", ""), body.get("held", False)
    is_plain = isinstance(file, str) and file == Path(file).name
    expect(file, f"{where}.file", is_plain, "the name of a file in the directory")
    expect(held, f"{where}.held", isinstance(held, bool), "true or false")
    joints = _gains_and_constants(body, where, factor)
    gain, constant = next(iter(joints.values()))
    by_joint = {number: both for number, both in joints.items() if number is not None}
    return ChannelTerm(column, str(body["unit"]), gain, constant, file, expression, held, by_joint)


def _gains_and_constants(
    body: Mapping[str, Any], where: str, factor: float
) -> dict[int | None, tuple[float, float]]:
    """Return gain and constant by the number of the joint; of None where the map has one for all.

    factor: to SI.
    """
    signs, scales, constants = (_numbers(body, where, name) for name in PER_JOINT)
    for sign in signs.values():
        expect(sign, f"{where}.sign", sign in (1, -1), "1 or -1")
    if 0.0 in scales.values():
        key = f"{where}.scale"
        raise FieldError(f"{key} is 0, expected another number: the channel would be lost", key)
    numbered = [list(values) for values in (signs, scales, constants) if None not in values]
    joints: list[int | None] = max(numbered, key=len, default=[None])
    for name, values in zip(PER_JOINT, (signs, scales, constants), strict=True):
        if None not in values and list(values) != joints:
            key = f"{where}.{name}"
            raise FieldError(f"{key} has numbers for {_named(values)}, expected {_named(joints)}", key)
    rows = [[v.get(joint, v.get(None, 0.0)) for v in (signs, scales, constants)] for joint in joints]
    return {joint: (a * factor * b, c) for joint, (a, b, c) in zip(joints, rows, strict=True)}


def _named(joints: Iterable[int | None]) -> str:
    return f"the joints {list_names([str(joint) for joint in joints])}"


def _numbers(body: Mapping[str, Any], where: str, name: str) -> dict[int | None, float]:
    """Return the numbers of a map by joint: one for all of them (None), a list from joint 0, or a mapping."""
    value, key = body.get(name, PER_JOINT[name]), f"{where}.{name}"
    if not isinstance(value, (list, Mapping)):
        return {None: number(value, key)}
    if not value:
        kind = "list" if isinstance(value, list) else "mapping"
        raise FieldError(f"{key} is an empty {kind}, expected a number for each joint", key)
    given = value if isinstance(value, Mapping) else dict(enumerate(value))
    for joint in given:
        if not isinstance(joint, int) or isinstance(joint, bool) or joint < 0:
            raise FieldError(f"{key} has the joint {quote(joint)}, expected its number", key)
    return {joint: number(given[joint], key) for joint in sorted(given)}


def _expression(body: Mapping[str, Any], field: str) -> Expression | None:
    """Return the expression of a term, None where it has a column."""
    if ("column" in body) == ("expression" in body):
        raise FieldError(f"{field}: expected either a column or an expression", field)
    if "column" in body:
        return None
    text = body["expression"]
    expect(text, f"{field}.expression", isinstance(text, str), "a text in quotes")
    try:
        return parse(text)
    except ValueError as error:
        raise FieldError(f"{field}.expression {error}", f"{field}.expression") from None


def expect(value: Any, field: str, is_so: bool, expected: str) -> Any:
    """Return a value. Raises FieldError where it is not as expected."""
    if not is_so:
        raise FieldError(f"{field} is {quote(value)}, expected {expected}", field)
    return value


def number(value: object, field: str) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < LARGEST
    return float(expect(value, field, is_number, "a number"))


def column_name(value: object, field: str) -> str:
    """Return the name of a column, or its number."""
    is_name = isinstance(value, (str, int)) and not isinstance(value, bool)
    return str(expect(value, field, is_name, "a name; put quotes around it")).strip()


def checked_keys(value: object, field: str, keys: Sequence[Key]) -> Mapping[str, Any]:
    """Return a mapping that has only these keys, and all of them that are needed."""
    allowed = ", ".join(sorted(key.name for key in keys))
    if not isinstance(value, Mapping):
        held = "empty" if value is None else quote(value)
        raise FieldError(f"{field} is {held}, expected a mapping with {allowed}", field)
    for name in value:
        if name not in [key.name for key in keys]:
            raise FieldError(f"{field}: unknown key {quote(name)}, expected {allowed}", f"{field}.{name}")
    needed = sorted(key.name for key in keys if key.default == NEEDED)
    for name in needed:
        if name not in value:
            raise FieldError(f"{field}: no {name!r}, expected {', '.join(needed)}", field)
    return value


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
    channels: Mapping[str, tuple[ChannelTerm, ...]]
    time: ChannelTerm | None
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


_Channels = dict[str, tuple[ChannelTerm, ...]]
_TEXT = {"header": None, "decimal": ".", "delimiter": None}
"""Keys of a text file, and their values where they are left out."""


def _map(path: Path, document: object) -> ImportMap:
    if isinstance(document, Mapping) and "channels" in document and "time" not in document:
        expected = f"a column with its unit, `{{rate: 1000}}` Hz, or `{SET_POINTS}` for readings at rest"
        raise FieldError(f"map: no 'time', expected {expected}", "map")
    body = checked_keys(document, "map", MAP)
    set_points = body["time"] == SET_POINTS
    time = checked_keys({"rate": 1.0} if set_points else body["time"], "time", TIME)
    if ("rate" in time) == ("column" in time or "expression" in time):
        raise FieldError("time: expected either a column with its unit, or a rate in Hz", "time")
    rate = number(time["rate"], "time.rate") if "rate" in time else None
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
    channels = checked_keys(body["channels"], "channels", CHANNEL)
    runs = checked_keys(body["runs"], "runs", RUNS)["column"] if "runs" in body else None
    header, decimal, delimiter = (body.get(k, v) for k, v in _TEXT.items())
    expect(header, "header", header is None or isinstance(header, bool), "true or false")
    expect(decimal, "decimal", decimal in (".", ","), "'.' or ','")
    known = delimiter is None or (isinstance(delimiter, str) and delimiter in DELIMITERS)
    expect(delimiter, "delimiter", known, f"one of {', '.join(map(repr, DELIMITERS))}")
    return ImportMap(
        path=path,
        channels=_one_kind({name: terms_of(name, value) for name, value in channels.items()}),
        time=None if rate else term_of("time", time, "time"),
        rate=rate,
        where=_rows(body["where"]) if "where" in body else None,
        delimiter=delimiter and DELIMITERS[delimiter],
        runs=None if runs is None else column_name(runs, "runs.column"),
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
    body = checked_keys(value, "where", WHERE)
    limits = {key: number(body[key], f"where.{key}") for key in ("from", "below") if key in body}
    equals = body.get("equals")
    if not limits and equals is None:
        raise FieldError("where: expected one of from, below, equals", "where")
    if equals is not None and not isinstance(equals, str):
        equals = number(equals, "where.equals")
    column = column_name(body["column"], "where.column")
    return RowFilter(column, limits.get("from"), limits.get("below"), equals)
