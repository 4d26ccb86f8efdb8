"""Finding about a machine that stands still for a while although the command goes on."""

from __future__ import annotations

import numpy as np

from rsea_ros.checks.finding import Finding
from rsea_ros.checks.moved_spans import moves
from rsea_ros.records.record import SENSED, BoolArray, Channel, FloatArray, Record

_LONGEST, _SHARE = 1.0, 0.1
"""s, and share of the record: a shorter standstill is one of friction at a turn of the command."""
_AROUND, _FEWEST, _MOSTLY = 0.25, 9, 0.8
"""s, samples, and share of them: noise passes for motion now and then, a turn of the command for rest."""
_HARDLY = 0.1
"""Of its range: a sensor at rest has noise, and the end of a motion that fades."""
_GOES_ON = 0.3
"""Share of that time in which the command changes clearly."""


def standstill_findings(record: Record) -> list[Finding]:
    """Return the finding of the longest standstill under a command. record: finite values, rising stamps."""
    sensors = [record[n] for n in SENSED if n in record and np.ptp(record[n].y) > 0.0]
    if "command" not in record or not sensors or np.ptp(record["command"].t) < _LONGEST:
        return []
    command, t = moves(record["command"]), record["command"].t
    still = np.ones(len(t), bool)
    for channel in sensors:
        moved = moves(channel)
        covered = (t >= channel.t[0]) & (t <= channel.t[-1])
        still &= covered & ~moved[np.clip(np.searchsorted(channel.t, t), 0, len(moved) - 1)]
    around = min(max(_FEWEST, round(_AROUND * record["command"].rate)), len(t))
    mostly = np.convolve(still, np.full(around, 1.0 / around), "same") > _MOSTLY
    first, last = _longest(mostly, t)
    length = float(t[last] - t[first])
    if not all(_rests(channel, float(t[first]), float(t[last])) for channel in sensors):
        return []
    if length < max(_LONGEST, _SHARE * float(t[-1] - t[0])) or command[first : last + 1].mean() < _GOES_ON:
        return []
    return [
        Finding(
            "amber",
            "standstill",
            "",
            length,
            "s",
            expected="motion while the command changes",
            detail=f"from {t[first]:.4g} s to {t[last]:.4g} s nothing moves while the command goes on",
            remedy="was the motor on, the command above the friction? If not, cut the record there",
        )
    ]


def _rests(channel: Channel, start: float, stop: float) -> bool:
    """Return whether a channel changes between two times, s, by a small part of its range in the run."""
    y = channel.between(start + _AROUND, stop - _AROUND).y
    return bool(len(y) and np.ptp(y) < _HARDLY * np.ptp(channel.y))


def _longest(still: BoolArray, t: FloatArray) -> tuple[int, int]:
    """Return the first and the last sample of the longest run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    if not len(edges):
        return 0, 0
    k = int(np.argmax(t[edges[1::2] - 1] - t[edges[::2]]))
    return int(edges[::2][k]), int(edges[1::2][k] - 1)
