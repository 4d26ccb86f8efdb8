"""Raw codes in columns of whole numbers: integers without their sign, sign and magnitude, encoder counts.

A device's register is a number of 8, 16 or 32 bits. Read as unsigned, -1 is 65535; a servo may hold its sign
in bit 10, 11 or 15; an encoder begins anew at a power of two. A column is taken for ordinary unless the
reading as a code joins what is apart: each jump of half the code's range or more becomes a step like its
neighbours, or two groups of values at the ends of the range meet at zero. Decision 0242 has what that costs.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from msg_adapters.tables.expression import COLUMN, FUNCTIONS, PLAIN
from rsea_ros.records.record import FloatArray

_WORDS, _SIGN_BITS = (8, 16, 32), (10, 11, 15)
_FEWEST = 8
"""Different values. Fewer are states or levels, not a measurement."""
_JOINED, _NEIGHBOURS, _SLACK = 0.8, 2.0, 2.0
"""Share of the jumps that must become steps of at most this many times their neighbours', and counts more."""
_GROUP, _NEAR, _LONG_WORD = 0.25, 1 / 64, 2**15
"""Share of the range up to which each of two groups goes, and from which it must begin; groups of a word this
long that lie so near zero need no more values than two."""
_OFTEN = 0.02
"""Share of a group in the eighth of it that is next to zero: of a sine 0.08, of a level with noise 0.005."""
_WRAPS, _LONG_CIRCLE = 2, 4096
"""Turns of a circle of fewer counts than this; a single jump may be an encoder that was set to zero."""
_WHOLE, _RECORD, _FARTHEST = {1.0: "rad", 2.0 * math.pi: "turns"}, 100, 20.0
"""Units, by their gain, in which no angle is logged in whole numbers; of more samples, and farther."""


@dataclass(frozen=True)
class _Reading:
    """A column read as a code, in words and in a map.

    jump: of the codes between neighbouring values. span: how many codes there are.
    """

    what: str
    remedy: str
    values: FloatArray
    jump: float
    span: float
    is_circle: bool = False


def raw_code(column: str, values: FloatArray, gain: float | None = None) -> tuple[str, str] | None:
    """Return which code a column holds and the keys of a map that read it; None for an ordinary column.

    values: as in the file, shape (n,), NaN where missing. gain: rad a count by the map where the column is an
    angle, None otherwise.
    """
    x = values[~np.isnan(values)]
    if len(x) < _FEWEST or np.any(x != np.rint(x)) or len(np.unique(x)) < _FEWEST:
        return None
    name = column if column.isidentifier() and column not in FUNCTIONS else f"{COLUMN}('{column}')"
    for one in _readings(name, x, gain):
        if _joins(x, one) or (not one.is_circle and _meet(one)):
            return one.what, one.remedy
    if gain is not None and abs(gain) in _WHOLE and len(x) > _RECORD and np.ptp(x) > _FARTHEST:
        turn = f'`unit: "1"` with `scale:` 2 pi over the counts of a turn, {math.pi / 2048:.9g} for 4096'
        return f"whole {_WHOLE[abs(gain)]} alone: counts of an encoder?", turn
    return None


def _readings(name: str, x: FloatArray, gain: float | None) -> Iterator[_Reading]:
    low, high = float(x.min()), float(x.max())
    for bits in _WORDS if low >= 0.0 else ():
        if 2 ** (bits - 1) <= high < 2**bits:
            what, y = f"signed {bits} bit numbers read as unsigned", PLAIN[f"int{bits}"][0](x)
            yield _Reading(what, f'`expression: "int{bits}({name})"`', y, 2.0**bits, 2.0**bits)
    for bit in _SIGN_BITS if low >= 0.0 else ():
        if 2**bit < high < 2 ** (bit + 1):
            what, y = f"numbers whose bit {bit} is their sign", PLAIN["sign_magnitude"][0](x, bit)
            yield _Reading(what, f'`expression: "sign_magnitude({name}, {bit})"`', y, 2.0**bit, 2.0**bit * 2)
    circle = 2.0 ** math.ceil(math.log2(max(high + 1.0, -2.0 * low, 2.0 * high + 2.0 if low < 0.0 else 0.0)))
    if gain is not None and 2**8 <= circle <= 2**32:
        gear = abs(gain) * circle / (2.0 * math.pi)
        factor = f"{gear:.6g} * " if 0.0 < gear < 0.99 else ""
        unwrapped = x - circle * np.cumsum(np.rint(np.diff(x, prepend=x[0]) / circle))
        what = f"encoder counts that begin anew at {circle:.0f}"
        remedy = f'`expression: "{factor}unwrap({2.0 * math.pi / circle:.9g} * {name})"`, `unit: rad`'
        yield _Reading(what, remedy, unwrapped, circle, circle, is_circle=True)


def _joins(x: FloatArray, one: _Reading) -> bool:
    """Return whether the jumps of a column are steps like their neighbours in the other reading."""
    steps = np.abs(np.diff(one.values))
    jumps = np.flatnonzero(np.abs(np.diff(x)) > 0.5 * one.jump)
    if len(jumps) < (_WRAPS if one.jump < _LONG_CIRCLE else 1) or steps.max() >= 0.25 * one.jump:
        return False
    others = steps.copy()
    others[jumps] = 0.0
    around = np.maximum(others[np.maximum(jumps - 1, 0)], others[np.minimum(jumps + 1, len(steps) - 1)])
    return bool(np.mean(steps[jumps] <= _NEIGHBOURS * around + _SLACK) >= _JOINED)


def _meet(one: _Reading) -> bool:
    """Return whether the values of the other reading are two groups that begin at zero and end soon.

    A measurement that goes through zero is often near it; two levels with noise hardly ever are.
    """
    size, below = np.abs(one.values), one.values < 0.0
    is_short = one.jump < _LONG_WORD or size.max() > _NEAR * one.jump
    for group in (size[below], size[~below]):
        levels = np.unique(group)
        if is_short and (len(levels) < _FEWEST or levels[0] > _NEAR * one.jump):
            return False
        if len(levels) >= _FEWEST and np.mean(group <= levels[-1] / 8) < _OFTEN:
            return False
    return len(np.unique(size[below])) > 1 and bool(size.max() <= _GROUP * one.span)
