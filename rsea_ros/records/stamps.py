"""Stamps as they can be used: in order, without repeats, on the clock that took the measurements.

A clock that jumped shifts all the samples after the jump: sorted, they would mix with those before it, so
the jump is removed first. A motor torque that belongs behind the edge of its command goes there.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.errors import ChannelError
from rsea_ros.records.coverage import absent_spans, without_mixed_rows
from rsea_ros.records.holds import (
    COMMANDS,
    behind_the_edge,
    paused_steps,
    with_held_commands,
    without_held_samples,
)
from rsea_ros.records.record import BoolArray, Channel, Fault, FloatArray, Record
from rsea_ros.records.stamp_order import (
    LONGEST_PAUSE,
    dropped_samples,
    far_apart,
    jumps_back,
    median_period,
    sort_by_stamp,
    stray_fault,
)

_FEWEST_TICKS = 10
"""Fewer show no rate."""
_SLACK = 0.05
"""Of a tick: so far off may the line be that is drawn through stamps rounded to ticks."""


def even_behind_ticks(t: FloatArray) -> FloatArray | None:
    """Return the even stamps that a clock rounded to its ticks, s, shape of t; None where no such fit.

    The line through all samples, where each stamp lies within half a tick of it. A rate that wanders, a lost
    sample and a pause each leave that band, which rounding alone fills. t: s, not decreasing.
    """
    ticks = t[np.flatnonzero(np.diff(t, prepend=-np.inf) > 0.0)]
    if len(ticks) == len(t) or len(ticks) < _FEWEST_TICKS:
        return None
    tick = float(np.median(np.diff(ticks)))
    place = np.arange(len(t)) - 0.5 * (len(t) - 1)
    slope = float(place @ (t - t[0])) / float(place @ place)
    even: FloatArray = np.asarray(float(np.mean(t)) + slope * place)
    return even if np.max(np.abs(t - even)) <= (0.5 + _SLACK) * tick else None


_SHORTEST_JUMP = 5.0
"""In sample periods: less than that a channel may well end later than the others, by chance."""
_REPEAT = 1e-3
"""Of nearly all steps: what is closer is a repeat."""
_NEW_VALUES = 0.5
"""Share of samples with a stamp that repeats that differ from the one before, from which none is a copy."""
_MOST_PLACES, _MOST_PER_SAMPLE = 1e7, 100.0
"""Periods that a channel may span, and times its number of samples: a long run at 2 kHz has 1e6."""
_EXPLAIN_GAPS = ("duplicate_stamps", "dropped_samples")
"""Kinds of faults that include the gaps once they are reported."""


def repair_stamps(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with rising stamps, and the defects of the stamps that it does not report yet.

    Raises ChannelError for stamps so uneven that no clock of a sensor can have made them.
    """
    faults: list[Fault] = []
    record, shared = _without_long_pauses(record)
    record, mixed = without_mixed_rows(record)
    faults += [*shared, *mixed]
    channels = {}
    for name, channel in record.channels.items():
        channel, jumps = _without_jumps(channel, name, _expected_span(record, name), _pauses(record, name))
        channel, disorder = sort_by_stamp(channel, name)
        count = len(channel)
        channel, repeats = _without_repeats(channel, name)
        faults += [*jumps, *disorder, *repeats]
        _check_even(channel, f"{record.source}: {name}")
        pauses = paused_steps(record.with_channels(**{name: channel}), name) if name in COMMANDS else None
        faults += dropped_samples(channel, name, count - len(channel), pauses)
        channels[name] = channel
    repaired, held = without_held_samples(record.with_channels(**channels))
    repaired, _ = with_held_commands(repaired)
    repaired, early = behind_the_edge(repaired)
    faults += [*held, *early]
    explained = {fault.channel for fault in record.faults if fault.kind in _EXPLAIN_GAPS}
    new = [fault for fault in faults if fault.kind != "dropped_samples" or fault.channel not in explained]
    return repaired, [*new, *(fault for fault in absent_spans(repaired) if fault not in record.faults)]


def _without_repeats(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Return a channel without stamps that repeat, and the fault.

    Repeats with other values that fit an even clock are samples between the ticks of a coarse one; all others
    are left out but for the first of each.
    """
    repeated = np.diff(channel.t, prepend=-np.inf) <= _repeat(channel.t)
    if not repeated.any():
        return channel, []
    even, share = even_behind_ticks(channel.t), float(repeated.mean())
    if even is None or np.mean(np.diff(channel.y)[repeated[1:]] != 0.0) < _NEW_VALUES:
        channel = Channel(channel.t[~repeated], channel.y[~repeated])
        return channel, [Fault("duplicate_stamps", name, share)]
    detail = f"{int(repeated.sum())} of {len(even)} stamps repeat: dated by the even clock that they fit"
    return Channel(even, channel.y), [Fault("coarse_stamps", name, share, detail)]


def _repeat(t: FloatArray) -> float:
    """Return up to which step two samples are one, s: a small part of nearly all steps."""
    step = np.diff(t)
    return _REPEAT * float(np.quantile(step[step > 0.0], 0.9)) if np.any(step > 0.0) else 0.0


def _check_even(channel: Channel, where: str) -> None:
    """Raise ChannelError for stamps that nearly all lie together, in far fewer places than their span has.

    This bounds the size of a grid of their period over their span.
    """
    if len(channel) < 3:
        return
    places = float(np.ptp(channel.t)) / median_period(channel.t)
    if places > max(_MOST_PLACES, _MOST_PER_SAMPLE * len(channel)):
        raise ChannelError(
            f"{where}: {len(channel)} stamps, half of them {median_period(channel.t):.3g} s apart, over"
            f" {np.ptp(channel.t):.3g} s, expected even sampling"
        )


def _without_long_pauses(record: Record) -> tuple[Record, list[Fault]]:
    """Leave out few samples far from all others; where all channels pause for too long, the clock was set."""
    faults: list[Fault] = []
    channels = {}
    for name, channel in record.channels.items():
        channels[name], stray = _without_stray_parts(channel, name)
        faults += stray
    pauses = {name: np.abs(np.diff(c.t)) > _pause(c.t) for name, c in channels.items()}
    if all(at.any() for at in pauses.values()):
        for name, at in pauses.items():
            channels[name], jump = _shorten_steps(channels[name], name, at)
            faults += jump
    return record.with_channels(**channels), faults


def _pause(t: FloatArray) -> float:
    """Return from which step on a channel pauses, s."""
    return max(LONGEST_PAUSE, _SHORTEST_JUMP * median_period(t))


def _without_stray_parts(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Leave out the few samples that lie far from the others."""
    stray = far_apart(channel.t, LONGEST_PAUSE)
    if not stray.any():
        return channel, []
    return Channel(channel.t[~stray], channel.y[~stray]), [stray_fault(stray, name)]


def _expected_span(record: Record, name: str) -> float:
    """Return how long a channel should last, s: as the command; the command as the others."""
    if name != "command" and "command" in record and len(record["command"]) > 1:
        return float(np.ptp(record["command"].t))
    spans = {(len(c), float(np.ptp(c.t))) for n, c in record.channels.items() if n != name and len(c) > 1}
    return float(np.median([span for _, span in spans])) if spans else 0.0


def _pauses(record: Record, name: str) -> FloatArray:
    """Return begin and end (s) of the pauses of the channel that a span is expected from, shape (2, n)."""
    others = [n for n in record.channels if n != name]
    beside = next((n for n in others if n == "command"), next(iter(others), name))
    t = record[beside].t
    if len(t) < 3:
        return np.empty((2, 0))
    long = np.diff(t) > _SHORTEST_JUMP * median_period(t)
    return np.array([t[:-1][long], t[1:][long]])


def _without_jumps(
    channel: Channel, name: str, expected: float, beside: FloatArray
) -> tuple[Channel, list[Fault]]:
    """Take out steps of the clock: those back for good, and one that makes the channel longer than others.

    beside: pauses of another channel, s, (2, n): one at the same time is a gap of both.
    """
    if len(channel) < 3:
        return channel, []
    at = jumps_back(channel.t)
    step = np.diff(channel.t)
    period = median_period(channel.t)
    surplus = float(channel.t[-1] - channel.t[0]) - expected if expected else 0.0
    largest = int(np.argmax(step))
    if (
        expected
        and step[largest] > _SHORTEST_JUMP * period
        and abs(step[largest] - period - surplus) < 2.0 * period
        and not _is_shared(channel.t[largest : largest + 2], beside)
    ):
        at[largest] = True
    return _shorten_steps(channel, name, at) if at.any() else (channel, [])


def _is_shared(step: FloatArray, beside: FloatArray) -> bool:
    """Return whether another channel has no sample either in the middle half of a step (begin and end, s)."""
    begin, end = np.interp((0.25, 0.75), (0.0, 1.0), step)
    return bool(np.any((beside[0] <= begin) & (beside[1] >= end)))


def _shorten_steps(channel: Channel, name: str, at: BoolArray) -> tuple[Channel, list[Fault]]:
    """Return the channel with each step of `at` as long as a period, and the fault."""
    step = np.diff(channel.t)
    shift = np.concatenate([[0.0], np.cumsum(np.where(at, step - median_period(channel.t), 0.0))])
    first, largest = int(np.argmax(at)), float(np.abs(shift).max())
    detail = f"{largest:.4g} s at {channel.t[first]:.3f} s"
    share = 1.0 - (first + 1) / len(channel.t)
    return Channel(channel.t - shift, channel.y), [Fault("clock_jump", name, share, detail, largest, "s")]
