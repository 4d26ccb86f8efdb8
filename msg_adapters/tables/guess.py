"""A first import map for a text table: which column looks like which channel, and what the file can't tell.

What a column is comes from its name, and from the data where they can speak: stamps increase, a velocity is
the rate of a position, whole numbers may be a device's codes. A unit that neither the name nor a row of units
states is asked for in a comment.
"""

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import lstsq

from msg_adapters.tables.column_table import CHANNELS, FACTORS, LINEAR, Table, Wanted, canonical, unit
from msg_adapters.tables.importing import without_wraps
from msg_adapters.tables.raw_codes import raw_code
from msg_adapters.tables.text_file import column_names, read_text, seconds_of
from rsea_ros.errors import ImportMapError
from rsea_ros.records.record import FloatArray

_ANGLE = r"pos|angle|theta|phi|encoder|ticks|_q\d*_"
_RATE = r"vel|speed|_dq\d*_|_qd\d*_"
_WISHED = "target|goal|des_|desired|ref|cmd|command|setpoint"
_WORDS: Mapping[str, str] = {
    "reference_velocity": f"({_WISHED}).*({_RATE})|({_RATE}).*({_WISHED}|_d_)",
    "reference": f"({_WISHED}).*({_ANGLE})|({_ANGLE}).*({_WISHED}|_d_)",
    "command": f"^_u_$|{_WISHED}|_[dc]_$|feed_?forward|_ff_",
    "deflection": "defl|spring|twist|delta",
    "ft": "^_ft|^_[tmf][xyz]|load_?cell|wrench|(sensor|output).*(torq|force)|(torq|force).*(sensor|output)",
    "velocity": r"^_[wv]_|_dq\d*_|_qd|vel|omega|speed|rpm|_rate_",
    "position": _ANGLE,
    "motor_torque": "tau|torque|effort|load|curr|_i_|_i?q_|_i_q",
}
"""What is in a channel's column's name, between underlines; the first that fits counts."""
_TIMES = re.compile("^_t_$|time|stamp|_secs?_|nanos?|clock|millis|micros")
_IN_NAME, _ENDING = re.compile(r"[\[(]([^\])]+)[\])]"), re.compile(r"_([A-Za-z]+)$")
_YAML = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}
"""Words that YAML takes for values."""
_SHORT = {"nm": "N m", "mnm": "mN m", "ma": "mA", "a": "A", "degps": "deg/s", "radps": "rad/s", "sec": "s"}
"""Units as names of columns write them."""
_CURRENT, _TORQUE = re.compile("curr|(?<!st)amp|_i_|_iq_|_i_q"), re.compile("tau|torque|effort|load")
_RATES = 3.0, 50_000.0
"""Hz, that a log has."""
_SAME, _FACTOR = 0.9, 0.05
"""Correlation from which a column is the rate of another, and the relative error of its factor."""
_ASKED = {"angle": "rad", "angular velocity": "rad/s", "torque": "N m"}
"""By dimension: the unit that is written where nothing shows it."""


def guess_map(path: str | Path) -> str:
    """Return the text of a map for a text table. Raises ImportMapError with file, line, column and value."""
    path = Path(path)
    try:
        units, delimiter = column_names(path)
        wanted = Wanted(tuple(units), labels=frozenset(units), delimiter=delimiter)
        tables = {decimal: read_text(path, replace(wanted, decimal=decimal)) for decimal in (".", ",")}
        decimal, table = max(tables.items(), key=lambda item: len(item[1].columns))
        first = {name: str(labels[0]) for name, labels in table.labels.items()}
        dated = frozenset(name for name, text in first.items() if seconds_of(text) is not None)
        units = {f"{n}[0]" if first.get(n, "").startswith("[") else n: text for n, text in units.items()}
        labels = frozenset(first.keys() & units.keys()) - dated
        kept = replace(wanted, columns=tuple(units), labels=labels, stamps=dated, decimal=decimal)
        table = read_text(path, kept)
    except (OSError, ValueError) as error:
        raise ImportMapError(f"{path}: {error}") from None
    sign = ['decimal: ","'] if decimal == "," else []
    return "\n".join([f"about: {_quoted(path.name)}", *sign, *_lines(table, units)]) + "\n"


def _lines(table: Table, units: Mapping[str, str]) -> Iterator[str]:
    """Yield the lines of a map but the first. units: by column what a row of the file says."""
    held = {name: table[name] for name in units if name in table.columns}
    numbers = {n: y for n, y in held.items() if np.isfinite(y).sum() > 2 and np.nanmax(y) > np.nanmin(y)}
    stated = {name: _unit_in(name, text) for name, text in units.items()}
    yield "# A `?` asks for what the file does not say. Units:"
    yield from (f"#   {dimension}: {', '.join(names)}" for dimension, names in FACTORS.items())
    time, period, line = _time(numbers, table.dated, stated)
    yield line
    numbers.pop(time, None)
    for name, labels in table.labels.items():
        values = ", ".join(_quoted(str(value)) for value in np.unique(labels)[:4])
        name = _quoted(name)
        yield f"# {name} holds texts, {values}: `runs: {{column: {name}}}` makes a bag of each"
    channels, rates = _channels(numbers), _rates(numbers, period)
    if "position" not in channels and rates:
        channels["position"] = next(iter(rates))
    if channels.get("position") in rates:
        channels["velocity"] = rates[channels["position"]][0]
    if any(name.endswith("[0]") for name in units):
        yield "# [0] is the first of the numbers in a cell; [#] is that of the joint which --index chooses"
    yield "channels:"
    for channel in CHANNELS:
        if channel in channels:
            name, position = channels[channel], channels.get("position", "")
            of = stated[position] if stated.get(position) in FACTORS["angle"] else "rad"
            is_rate = channel == "velocity" and rates.get(position, ("",))[0] == name
            rate = (position, of, rates[position][1]) if is_rate else None
            yield f"  {channel}: {_term(channel, name, numbers[name], stated[name], rate)}"
    if "command" not in channels:
        yield "  # command: ? the commanded torque or current, or the measured one where no other was logged"
    for name in table.columns:
        if name not in (time, *channels.values()):
            yield f"# not used: {_quoted(name)}, {_range(table[name])}"


def _range(values: FloatArray) -> str:
    return f"{np.nanmin(values):.5g} to {np.nanmax(values):.5g}"


def _quoted(name: str) -> str:
    """Return a name as YAML takes it: a word as it is."""
    is_word = re.fullmatch(r"[A-Za-z_]\w*", name) and name.lower() not in _YAML
    return name if is_word else json.dumps(name, ensure_ascii=not name.isprintable())


def _words(name: str) -> str:
    """Return a name in small letters with underlines between and around its words, without its unit."""
    bare = re.sub(r"[\[(].*?[\])]", "", name)
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", bare).lower()
    return re.sub(r"[\W_]+", "_", f"_{words}_")


def _unit_in(name: str, row: str) -> str:
    """Return the unit that a row of units or the column's name states; empty without one."""
    match = _IN_NAME.search(name) or _ENDING.search(name)
    for text in (row.strip(" ()[]"), match[1] if match else ""):
        with suppress(ValueError):
            return canonical(_SHORT.get(text.lower(), text))
    return ""


def _time(
    numbers: Mapping[str, FloatArray], dated: frozenset[str], stated: Mapping[str, str]
) -> tuple[str, float, str]:
    """Return the column of the stamps, the median s between them, and the map's line."""
    steps = {name: np.diff(without_wraps(y)[0]) for name, y in numbers.items()}
    rising = {name: float(np.median(d)) for name, d in steps.items() if d.min() >= 0.0 < np.median(d)}
    named = [name for name in rising if _TIMES.search(_words(name)) or stated[name] in FACTORS["time"]]
    for name in named or [name for name in rising if np.ptp(steps[name]) < rising[name]]:
        if name in dated:
            return name, rising[name], f"time: {{column: {_quoted(name)}, unit: s}}  # date-times"
        known = stated[name] in FACTORS["time"]
        for one in [stated[name]] if known else ("s", "ms", "us", "ns"):
            hz = 1.0 / (rising[name] * FACTORS["time"][one])
            if known or _RATES[0] <= hz <= _RATES[1]:
                said = f"{hz:.4g} Hz" + ("" if known else f", as the step of {rising[name]:.4g} says")
                return name, 1.0 / hz, f"time: {{column: {_quoted(name)}, unit: {one}}}  # {said}"
    return "", 1e-3, "time: {rate: 1000}  # ? Hz: no column increases as stamps do"


def _channels(numbers: Mapping[str, FloatArray]) -> dict[str, str]:
    """Return the column of each channel by the names, the shortest name first."""
    found: dict[str, str] = {}
    for name in sorted(numbers, key=len):
        channel = next((c for c, words in _WORDS.items() if re.search(words, _words(name))), None)
        if channel is not None:
            found.setdefault(channel, name)
    free = [name for name in numbers if name not in found.values() or found.get("motor_torque") == name]
    currents = [name for name in free if _CURRENT.search(_words(name))]
    torques = [name for name in free if name not in currents and _TORQUE.search(_words(name))]
    if currents and torques and "ft" not in found:  # a sensor beside the motor's current
        found["motor_torque"], found["ft"] = currents[0], torques[0]
    return found


def _rates(numbers: Mapping[str, FloatArray], period: float) -> dict[str, tuple[str, float]]:
    """Return by column the one that is its rate, and the factor by which its integral is the column."""
    found: dict[str, tuple[str, float]] = {}
    whole = {name: y for name, y in numbers.items() if np.isfinite(y).all()}
    for name, y in whole.items():
        slope, likest = np.gradient(y, period), _SAME
        for other, x in whole.items() if np.ptp(slope) > 1e-9 * np.abs(slope).max() else ():
            likeness = 0.0 if other == name else float(np.corrcoef(slope, x)[0, 1])
            if abs(likeness) > likest:
                turned = _without_line(period * np.cumsum(x))
                likest = abs(likeness)
                found[name] = other, float(turned @ _without_line(y) / (turned @ turned))
    return found


def _without_line(y: FloatArray) -> FloatArray:
    """Return values less their best straight line: scipy.signal.detrend, whose import takes half a second."""
    line = np.column_stack([np.arange(1, len(y) + 1) / len(y), np.ones(len(y))])
    return np.asarray(y - line @ lstsq(line, y)[0])


def _term(
    channel: str, name: str, values: FloatArray, stated: str, rate: tuple[str, str, float] | None
) -> str:
    """Return a channel's term with its comment. rate: of which position, its unit, and by what factor."""
    dimension, said = CHANNELS[channel], [_range(values)]
    possible = {dimension, *(line for line, turn in LINEAR.items() if turn == dimension)}
    drives = {"current", "voltage"} if dimension == "torque" else set()
    written, asked = stated, not stated or unit(stated)[0] not in possible | drives
    if asked:
        is_current = drives and _CURRENT.search(_words(name))
        written = "A" if is_current else _ASKED[dimension]
        said.append("? unit")
    scaled = unit(written)[0] in drives
    if scaled:
        said.append(f"? scale: N·m at the gear output for each {written}")
    code = raw_code(name, values, FACTORS["angle"].get(written) if dimension == "angle" else None)
    if code is not None:
        said.append(f"{code[0]}: {code[1]}")
    if rate is not None:
        position, of, factor = rate
        ratio = factor * FACTORS["angle"][of]
        fits = [u for u, si in FACTORS[dimension].items() if abs(ratio / si - 1.0) < _FACTOR]
        written = fits[0] if asked and fits else written
        said.append(f"the rate of {_quoted(position)}")
        if written not in fits:
            said.append(f"? {FACTORS[dimension].get(written, 1.0) / ratio:.3g} times too large for that")
    scale = ", scale: 1.0" if scaled else ""
    return f"{{column: {_quoted(name)}, unit: {written}{scale}}}  # {'; '.join(said)}"
