"""Strict YAML: one value for a key, numbers as people write them, fields checked with unit and range.

Numbers are plain decimals (`1e-3` too). Text that YAML 1.1 but not a person reads as a number (`0x10`, `010`,
`1:30`, `1_000`, a date) is refused with its line, as are anchors, aliases and tags.
"""

import math
import re
import stat
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from rsea_ros.documents.units import plain, same_unit
from rsea_ros.documents.wording import did_you_mean, no_utf_8, quote
from rsea_ros.errors import FieldError

T = TypeVar("T")
_DECIMAL = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")


def is_decimal(text: str) -> bool:
    """Return whether a text is a number like `12`, `-0.5` or `1e-3` that a double can hold.

    `0x10`, `1_000`, `1:30`, `1,5`, `nan`, `inf` and `1e999` are not.
    """
    return bool(_DECIMAL.fullmatch(text)) and math.isfinite(float(text))


def decimal(text: str) -> float:
    """Return the number. Raises ValueError where `is_decimal` is false; blanks around it do not count."""
    if not is_decimal(text.strip()):
        raise ValueError(f"{text!r} is not a finite decimal number")
    return float(text)


LARGEST = 1 << 20
"""Bytes. The largest rig has 4 kB."""
DEEPEST = 16
"""Levels of nesting. A rig has 4."""
_CONSTANTS: dict[str, Any] = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_CONSTANTS |= {
    spelling: value
    for words, value in ((("true", "yes", "on"), True), (("false", "no", "off"), False))
    for word in words
    for spelling in (word, word.capitalize(), word.upper())
}  # fmt: skip
_CONSTANTS |= {
    sign + dot: float(sign + dot.lstrip(".")) for sign in ("", "+", "-") for dot in (".inf", ".Inf", ".INF")
}
_CONSTANTS |= dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan"))
_DOUBTFUL = {
    "hexadecimal": re.compile(r"[-+]?0[xX][0-9a-fA-F_]+"),
    "binary": re.compile(r"[-+]?0b[01_]+"),
    "octal": re.compile(r"[-+]?0(o|_*[0-9])[0-9_]*"),
    "sexagesimal": re.compile(r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?"),
    "a number with underscores": re.compile(r"[-+]?[0-9.]*[0-9]_[0-9_.]*([eE][-+]?[0-9]+)?"),
    "a date": re.compile(r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt ].*)?"),
}
_BEGINS_NUMBER = frozenset("+-.0123456789")
_LONGEST_NUMBER = 400
"""Characters. Python refuses to read integers of more than 4300 digits, and a double holds 309."""
Way = tuple[str, ...]


@dataclass(frozen=True)
class Document:
    """The content of a file: mappings, lists, texts, numbers, switches, None; and the line of each.

    lines: by the path to a value, keys and indices as texts.
    """

    content: Any
    lines: Mapping[Way, int]

    def where(self, field: str) -> str:
        """Return `line 7: ` of a dotted field such as `effects[0].name`, or of the nearest one above it."""
        way = tuple(re.findall(r"[^.\[\]]+", field))
        way = way if way[:1] in self.lines else way[1:]  # `rig.colour` is the key `colour` of a whole rig
        while way and way not in self.lines:
            way = way[:-1]
        line = self.lines.get((*way, "value"), self.lines.get(way))
        return f"line {line}: " if way else ""


def read(path: Path) -> Document:
    """Read a file. Raises OSError, and FieldError with line, key, value and the expected value."""
    if stat.S_ISFIFO(path.stat().st_mode):
        raise FieldError("is a pipe, expected a file")
    with path.open("rb") as file:
        data = file.read(LARGEST + 1)
    if len(data) > LARGEST:
        raise FieldError(f"more than {LARGEST} bytes, expected a file that a person wrote")
    try:
        return parse(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise FieldError(f"not YAML: {no_utf_8(error)}, expected text in UTF-8") from None


def load(path: Path, expected: str, error: Callable[[str, str], Exception], build: Callable[[Any], T]) -> T:
    """Return what `build` makes of a file's content. expected: what the file should be.

    Raises `error`, made of message and field: file, line, field, value and the expected value.
    """
    try:
        document = read(path)
    except OSError as wrong:
        raise error(f"{path}: {wrong.strerror}, expected {expected}", "") from None
    except FieldError as wrong:
        raise error(f"{path}: {wrong}", "") from None
    try:
        return build(document.content)
    except FieldError as wrong:
        raise error(f"{path}: {document.where(wrong.field)}{wrong}", wrong.field) from None


def parse(text: str) -> Document:
    """Return the document of a text. Raises FieldError with line, key, value and the expected value."""
    lines: dict[Way, int] = {}
    try:
        events = _check_events(yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
        first = next(events, None)
        content = None if first is None else _value(first, events, (), lines)
        if next(events, None) is not None:
            raise FieldError("not YAML: a second document, expected one")
    except yaml.YAMLError as error:
        raise FieldError(f"not YAML: {' '.join(str(error).split())}") from None
    return Document(content, lines)


class _Dumper(yaml.SafeDumper):
    """Quotes every text that would otherwise be read as another value."""


def _quote(dumper: _Dumper, text: str) -> yaml.ScalarNode:
    doubtful = any(pattern.fullmatch(text) for pattern in _DOUBTFUL.values())
    style = "'" if doubtful or is_decimal(text) or text in _CONSTANTS else None
    style = '"' if any(mark in text for mark in "\x85\u2028\u2029") else style  # line breaks, to YAML
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _quote)


def dump(document: Mapping[str, Any]) -> str:
    """Return the text that `parse` reads as the document."""
    return str(yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True))


def _check_events(events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
    """Yield the events that carry content; refuse the others."""
    depth = 0
    for event in events:
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise _refusal(event, "an anchor or alias (& or *), expected the value written out")
        tag = getattr(event, "tag", None)
        if tag not in (None, "!"):
            raise FieldError(f"not YAML: line {_line(event)}: tag {quote(tag)}, expected none")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise _refusal(event, f"nested more than {DEEPEST} deep")
        if isinstance(event, (yaml.ScalarEvent, yaml.CollectionStartEvent, yaml.CollectionEndEvent)):
            yield event


def _value(event: yaml.Event, events: Iterator[yaml.Event], way: Way, lines: dict[Way, int]) -> Any:
    """Return the value that begins with an event, taking what belongs to it from the events after it."""
    lines.setdefault(way, _line(event))
    if isinstance(event, yaml.ScalarEvent):
        return _scalar(event, ".".join(way) or "value")
    if isinstance(event, yaml.MappingStartEvent):
        return _mapping(events, way, lines)
    items: list[Any] = []
    for item in _until_end(events):
        items.append(_value(item, events, (*way, str(len(items))), lines))
    return items


def _mapping(events: Iterator[yaml.Event], way: Way, lines: dict[Way, int]) -> dict[Any, Any]:
    body: dict[Any, Any] = {}
    for event in _until_end(events):
        if not isinstance(event, yaml.ScalarEvent):
            raise _refusal(event, "a key that is not a single word, expected a name")
        key = _scalar(event, "key")
        name = (*way, str(key))
        if name in lines:
            raise _refusal(event, f"key {quote(key)} stands twice, first in line {lines[name]}")
        lines[name] = _line(event)
        body[key] = _value(next(events), events, name, lines)
    return body


def _until_end(events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
    """Yield where each part of a collection begins, up to the collection's end."""
    for event in events:
        if isinstance(event, yaml.CollectionEndEvent):
            return
        yield event


def _scalar(event: yaml.ScalarEvent, key: str) -> Any:
    """Return text, number, switch or None. A quoted one is a text."""
    text = str(event.value)
    if not event.implicit[0] or event.tag or len(text) > _LONGEST_NUMBER:
        return text
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if text[0] not in _BEGINS_NUMBER:  # as nearly all do
        return text
    for kind, pattern in _DOUBTFUL.items():
        if pattern.fullmatch(text):
            expected = "expected a decimal number, or a text in quotes"
            raise _refusal(event, f"{key}: {quote(text)} is {kind}, {expected}")
    if re.fullmatch(r"[-+]?[0-9]+", text):
        return int(text)
    return decimal(text) if is_decimal(text) else text


def _refusal(event: yaml.Event, reason: str) -> FieldError:
    return FieldError(f"line {_line(event)}: {reason}")


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0


def number(value: Any, name: str, unit: str) -> float:
    """Return a YAML value as a float. Raises FieldError when it is not a number."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        converted = float(value) if is_number else math.nan
    except OverflowError:
        converted = math.nan
    if math.isnan(converted):
        raise FieldError(f"{name} = {quote(value)}, expected a number ({plain(unit) or 1})", name)
    return converted


def sequence(value: Any, name: str, expected: str) -> list[Any]:
    """Return a list. Raises FieldError for anything else. expected: of what."""
    if not isinstance(value, list):
        raise FieldError(f"{name} = {quote(value)}, expected a list of {expected}", name)
    return value


def spread(body: Mapping[str, Any], name: str) -> float:
    """Return the relative one-sigma spread of a quantity, 0 where none is stated. Raises FieldError."""
    value = number(body.get("spread", 0.0), f"{name}.spread", "relative, one sigma")
    if not 0.0 <= value < 10.0:
        raise FieldError(
            f"{name}.spread = {value:g}, expected a relative one-sigma spread from 0 to 10", f"{name}.spread"
        )
    return value


def interval(value: Any, name: str, unit: str) -> tuple[float, float]:
    """Return [low, high] as two floats. Raises FieldError for anything else."""
    if not isinstance(value, list) or len(value) != 2:
        raise FieldError(f"{name} = {quote(value)}, expected [low, high] in {plain(unit)}", name)
    low, high = (number(v, name, unit) for v in value)
    return low, high


def switch(body: Mapping[str, Any], name: str) -> bool:
    """Return true or false of a group. Raises FieldError when it is something else."""
    value = body.get(name.split(".")[-1], False)
    if not isinstance(value, bool):
        raise FieldError(f"{name} = {quote(value)}, expected true or false", name)
    return value


def text(value: Any, name: str) -> str:
    """Return a text. Raises FieldError for a value of another type."""
    if not isinstance(value, str):
        raise FieldError(f"{name} = {quote(value)}, expected text", name)
    return value


def mapping(value: Any, name: str, expected: str = "a mapping") -> Mapping[str, Any]:
    """Return a mapping. Raises FieldError for a value of another type."""
    if not isinstance(value, Mapping):
        raise FieldError(f"{name} = {quote(value)}, expected {expected}", name)
    return value


def only_keys(body: Mapping[str, Any], allowed: set[str], where: str) -> None:
    """Raise FieldError for a key that is not allowed."""
    for key in body:
        if key not in allowed:
            expected = ", ".join(sorted(allowed)) + did_you_mean(str(key), allowed)
            raise FieldError(
                f"{where}: unknown key {quote(key)}, expected one of {expected}", f"{where}.{key}"
            )


def unit(value: Any, name: str, expected: str) -> None:
    """Raise FieldError for another unit than the one expected, however that is written."""
    if not same_unit(value, expected):
        raise FieldError(f"{name} = {quote(value)}, expected {expected!r}", name)


NEEDED = "required"


@dataclass(frozen=True)
class Key:
    """A key of a mapping: the expected value, the default, and the meaning."""

    name: str
    expects: str
    default: str
    meaning: str = ""


def names(keys: Collection[Key]) -> set[str]:
    """Return the names of keys."""
    return {key.name for key in keys}


def table(section: str, keys: Sequence[Key]) -> str:
    """Return a table of keys in Markdown."""
    head = [f"`{section}`:", "", "| key | expected | default | meaning |", "|---|---|---|---|"]
    return "\n".join([*head, *map(_row, keys)]) + "\n"


def _row(key: Key) -> str:
    cells = (f"`{key.name}`", key.expects.replace("|", "\\|"), key.default, key.meaning)
    return f"| {' | '.join(cells)} |"
