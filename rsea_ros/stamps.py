"""Corrected stamps of a run: samples in order, clock jumps removed, gaps and repeats reported.

Samples that only arrived out of order are sorted. A clock that jumped shifts all the samples after the jump:
sorted, they would mix with those before it, so the jump is removed first. The two are distinguished by
density: late samples are never denser in time than the ticks of the clock.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from rsea_ros.errors import ChannelError
from rsea_ros.signals import BoolArray, Channel, Fault, FloatArray, IntArray, Record

_GAP = 1.6
"""In sample periods: a longer interval is a gap."""
_AROUND = 8
"""Samples on either side of a gap or a jump that say whether it lasts."""
_SHORTEST_JUMP = 5.0
"""In sample periods: less than that a channel may well end later than the others, by chance."""
_REPEAT = 1e-3
"""Of nearly all steps: what is closer is a repeat."""
_MOST_PLACES, _MOST_PER_SAMPLE = 1e7, 100.0
"""Periods that a channel may span, and times its number of samples: a long run at 2 kHz has 1e6."""
_PLACES, _NO_GAP, _OUTSIDE = 2, 1.4, 10.0
"""A sample more places out of order than this is stray where those around it leave no gap, in periods, or
where it lies so many periods outside the run."""
_FOLLOW = 0.2
"""How far the steady clock behind the stamps goes towards each of them."""
_MANY_BACK = 0.02
"""Share of the steps: where more go back it is disorder, and steps in order of arrival say little."""
_OFTEN = 0.02
"""Share of the steps: where fewer are long, they are accidents and no habit of the host."""
_NO_MULTIPLE, _TIMES = 0.15, 3.0
"""In periods: so far off a whole number, and so many times farther than steps of one period are off, the
typical long step is no multiple."""
_MOST_JUMPS = 200
"""Steps back that are looked at, the longest first: no clock is set more often in a run."""
_LONGEST_PAUSE = 600.0
"""Seconds: as long as a long run. Whoever lays a grid over the record goes through its pauses too; a longer
one is taken for a clock that was set."""
LONGEST_PAUSE_NS = _LONGEST_PAUSE * 1e9
_FEW = 0.01
"""Share of a channel's samples that lie far from all others: they are stray, not the run."""

_FEWEST = 10
"""Samples of a channel: fewer say little of when it started."""
_ABSENT, _ABSENT_PERIODS, _ABSENT_SHARE = 0.5, 10.0, 0.02
"""s, sample periods, and share of the run: as late as that a sensor may start, by the start of a recorder."""

_EXPLAIN_GAPS = ("duplicate_stamps", "dropped_samples")
"""Kinds of faults that include the gaps once they are reported."""


def repair_stamps(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with rising stamps, and the defects of the stamps that it does not report yet.

    Raises ChannelError for stamps so uneven that no clock of a sensor can have made them.
    """
    faults: list[Fault] = []
    record, shared = _without_long_pauses(record)
    faults += shared
    channels = {}
    for name, channel in record.channels.items():
        channel, jumps = _without_jumps(channel, name, _expected_span(record, name))
        channel, disorder = _sorted(channel, name)
        repeated = np.diff(channel.t, prepend=-np.inf) <= _repeat(channel.t)
        faults += [*jumps, *disorder]
        if repeated.any():
            faults.append(Fault("duplicate_stamps", name, float(repeated.mean())))
            channel = Channel(channel.t[~repeated], channel.y[~repeated])
        _check_even(channel, f"{record.source}: {name}")
        faults += _dropped(channel, name, int(repeated.sum()))
        channels[name] = channel
    repaired = record.with_channels(**channels)
    explained = {fault.channel for fault in record.faults if fault.kind in _EXPLAIN_GAPS}
    new = [fault for fault in faults if fault.kind != "dropped_samples" or fault.channel not in explained]
    return repaired, [*new, *(fault for fault in _absent(repaired) if fault not in record.faults)]


def _absent(record: Record) -> list[Fault]:
    """Return a fault for each sensor that starts late or ends early, and for commands that end early.

    Commands that start after the sensors are usual: the bench runs before its excitation does.
    """
    driving = record.driving
    if driving is None or len(driving) < _FEWEST:
        return []
    last = max(float(c.t[-1]) for c in record.channels.values() if len(c))
    faults = []
    for name, channel in record.channels.items():
        if len(channel) < _FEWEST:
            continue
        start, stop = (driving.t[0], driving.t[-1]) if channel is not driving else (channel.t[0], last)
        longest = max(_ABSENT, _ABSENT_PERIODS * _period(channel.t), _ABSENT_SHARE * float(stop - start))
        late, early = float(channel.t[0] - start), float(stop - channel.t[-1])
        spans = [(late, start, channel.t[0])] if late > longest else []
        spans += [(early, channel.t[-1], stop)] if early > longest else []
        if spans:
            held = ", the last command is held" if channel is driving else ""
            faults.append(_absence(name, spans, float(stop - start), held))
    return faults


def _absence(name: str, spans: Sequence[tuple[float, float, float]], whole: float, then: str) -> Fault:
    """Return the fault of the spans without a channel: length, begin and end each, s. whole: the run, s."""
    lost = sum(length for length, _, _ in spans)
    detail = " and ".join(f"nothing from {a:.4g} s to {b:.4g} s" for _, a, b in spans)
    return Fault("partly_recorded", name, lost / whole, detail + then, lost, "s")


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
    places = float(np.ptp(channel.t)) / _period(channel.t)
    if places > max(_MOST_PLACES, _MOST_PER_SAMPLE * len(channel)):
        raise ChannelError(
            f"{where}: {len(channel)} stamps, half of them {_period(channel.t):.3g} s apart, over"
            f" {np.ptp(channel.t):.3g} s, expected even sampling"
        )


def in_order(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Return a channel sorted by its stamps, without stamps that fit nowhere, and its faults.

    A channel whose clock jumped back is returned unchanged: sorting would mix its samples.
    """
    return (channel, []) if jumps_back(channel.t).any() else _sorted(channel, name)


def _sorted(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Return a channel sorted by its stamps, without stamps that fit nowhere, and its faults."""
    if not np.any(np.diff(channel.t) < 0.0):
        return channel, []
    late = _out_of_order(channel.t)
    stray = _stray(channel.t, late)
    order = np.argsort(channel.t[~stray], kind="stable")
    sorted_channel = Channel(channel.t[~stray][order], channel.y[~stray][order])
    faults = []
    if count := int((late & ~stray).sum()):
        detail = f"first at {channel.t[int(np.argmax(late & ~stray))]:.6g} s, sorted"
        faults.append(Fault("out_of_order", name, count / len(channel), detail, count, "samples"))
    if stray.any():
        faults.append(stray_fault(stray, name))
    return sorted_channel, faults


def jumps_back(t: FloatArray) -> BoolArray:
    """Return after which samples the clock jumped back, shape (n - 1,)."""
    step = np.diff(t)
    period = _period(t)
    at = np.zeros(len(step), bool)
    candidates = np.flatnonzero(step < -0.5 * period)
    if not len(candidates) or period <= 0.0:
        return at
    lowest = np.minimum.accumulate(t)
    highest = np.maximum.accumulate(t[::-1])[::-1]
    for k in candidates[np.argsort(step[candidates], kind="stable")][:_MOST_JUMPS]:
        apart = highest[k + 1] < lowest[k] and min(k + 1, len(t) - k - 1) > _AROUND
        at[k] = apart or _mixes(t, int(k), period)
    return at


def _mixes(t: FloatArray, k: int, period: float) -> bool:
    """Return whether the samples after k lie between those before it, rather than where these leave gaps."""
    low, high = float(t[k + 1]), float(t[k])
    around = int(min(len(t), 4.0 * (high - low) / period + 2 * _AROUND))
    before = t[max(0, k + 1 - around) : k + 1]
    after = t[k + 1 : k + 1 + around]
    shift = _level(after[:_AROUND], period) - _level(before[-_AROUND:], period, before=True)
    high = min(high, float(after.max()))
    due = (high - low) / period + 1.0
    within = [int(np.count_nonzero((part >= low) & (part <= high))) for part in (before, after)]
    lasts = within[1] >= min(_AROUND // 2, due)
    return shift < -0.75 * period and sum(within) > 1.5 * due and lasts


def _level(t: FloatArray, period: float, *, before: bool = False) -> float:
    """Return where the clock of some samples stands at the step that they begin or end at, s."""
    places = np.arange(len(t)) - (len(t) if before else 0)
    return float(np.median(t - places * period))


def _period(t: FloatArray) -> float:
    """Return the sample period, s: the median step forward; where many go back, of the sorted stamps."""
    step = np.diff(t)
    if np.count_nonzero(step < 0.0) > _MANY_BACK * len(step):
        step = np.diff(np.sort(t))
    forward = step[step > 0.0]
    return float(np.median(forward)) if len(forward) else 0.0


def _out_of_order(t: FloatArray) -> BoolArray:
    """Return the fewest samples without which the others are in order (all but a longest rising part)."""
    ends: list[float] = []
    places: list[int] = []
    previous = np.full(len(t), -1)
    for k, value in enumerate(t.tolist()):
        at = bisect_right(ends, value)
        previous[k] = places[at - 1] if at else -1
        ends[at : at + 1] = [value]
        places[at : at + 1] = [k]
    late = np.ones(len(t), bool)
    k = places[-1]
    while k >= 0:
        late[k] = False
        k = int(previous[k])
    return late


def _stray(t: FloatArray, late: BoolArray) -> BoolArray:
    """Return which samples out of order have a stamp that is not theirs: no gap is waiting for them there."""
    kept = t[~late]
    rank: IntArray = np.cumsum(~late)
    at = np.searchsorted(kept, t[late])
    left, right = kept[np.maximum(at - 1, 0)], kept[np.minimum(at, len(kept) - 1)]
    period = _period(kept) or 1.0
    near = np.minimum(np.abs(t[late] - left), np.abs(right - t[late])) / period
    outside = (at == 0) | (at == len(kept))
    unfit = np.where(outside, near > _OUTSIDE, right - left < _NO_GAP * period)
    stray = np.zeros(len(t), bool)
    stray[late] = (np.abs(at - rank[late]) > _PLACES) & unfit
    return stray


def _without_long_pauses(record: Record) -> tuple[Record, list[Fault]]:
    """Leave out few samples far from all others; where all channels pause for too long, the clock was set."""
    faults: list[Fault] = []
    channels = {}
    for name, channel in record.channels.items():
        channels[name], stray = _without_stray_parts(channel, name)
        faults += stray
    pauses = {name: np.abs(np.diff(c.t)) > _LONGEST_PAUSE for name, c in channels.items()}
    if all(at.any() for at in pauses.values()):
        for name, at in pauses.items():
            channels[name], jump = _taken_out(channels[name], name, at)
            faults += jump
    return record.with_channels(**channels), faults


def _without_stray_parts(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Leave out the few samples that lie far from the others."""
    stray = far_apart(channel.t, _LONGEST_PAUSE)
    if not stray.any():
        return channel, []
    return Channel(channel.t[~stray], channel.y[~stray]), [stray_fault(stray, name)]


def far_apart(t: FloatArray | IntArray, longest: float = LONGEST_PAUSE_NS) -> BoolArray:
    """Return which stamps are the few that lie further than `longest` from all others, in the unit of t."""
    breaks = np.flatnonzero(np.abs(np.diff(t)) > longest) + 1
    stray = np.zeros(len(t), bool)
    if len(breaks):
        for part in np.split(np.arange(len(t)), breaks):
            stray[part] = len(part) <= max(1.0, _FEW * len(t))
    return stray if not stray.all() else np.zeros(len(t), bool)


def stray_fault(stray: BoolArray, name: str) -> Fault:
    """Return the fault of samples left out because their stamps are not theirs."""
    count = int(stray.sum())
    detail = f"first is sample {int(np.argmax(stray))}, left out"
    return Fault("stray_stamps", name, count / len(stray), detail, count, "samples")


def _expected_span(record: Record, name: str) -> float:
    """Return how long a channel should last, s: as the command; the command as the others."""
    if name != "command" and "command" in record and len(record["command"]) > 1:
        return float(np.ptp(record["command"].t))
    spans = {(len(c), float(np.ptp(c.t))) for n, c in record.channels.items() if n != name and len(c) > 1}
    return float(np.median([span for _, span in spans])) if spans else 0.0


def _without_jumps(channel: Channel, name: str, expected: float) -> tuple[Channel, list[Fault]]:
    """Take out steps of the clock: those back for good, and one that makes the channel longer than others."""
    if len(channel) < 3:
        return channel, []
    at = jumps_back(channel.t)
    step = np.diff(channel.t)
    period = _period(channel.t)
    surplus = float(channel.t[-1] - channel.t[0]) - expected if expected else 0.0
    largest = int(np.argmax(step))
    if (
        expected
        and step[largest] > _SHORTEST_JUMP * period
        and abs(step[largest] - period - surplus) < 2.0 * period
    ):
        at[largest] = True
    return _taken_out(channel, name, at) if at.any() else (channel, [])


def _taken_out(channel: Channel, name: str, at: BoolArray) -> tuple[Channel, list[Fault]]:
    """Return the channel with each step of `at` as long as a period, and the fault."""
    step = np.diff(channel.t)
    shift = np.concatenate([[0.0], np.cumsum(np.where(at, step - _period(channel.t), 0.0))])
    first, largest = int(np.argmax(at)), float(np.abs(shift).max())
    detail = f"{largest:.4g} s at {channel.t[first]:.3f} s"
    share = 1.0 - (first + 1) / len(channel.t)
    return Channel(channel.t - shift, channel.y), [Fault("clock_jump", name, share, detail, largest, "s")]


def _dropped(channel: Channel, name: str, taken_out: int) -> list[Fault]:
    """Return the fault of missing samples. taken_out: how many had a stamp that was not theirs."""
    step = np.diff(channel.t)
    period = float(np.median(step)) if len(step) else 0.0
    if not np.any(step > _GAP * period) or polls_unevenly(step, period):
        return []
    ticks = _ticks(step, period)
    lost = float(np.median(ticks[-3:] - np.arange(len(ticks))[-3:])) - taken_out
    if lost < 1.0:
        return []
    longest = int(np.argmax(step))
    detail = f"longest gap {step[longest]:.4g} s at {channel.t[longest]:.3f} s"
    return [Fault("dropped_samples", name, lost / (len(channel) + lost), detail, lost, "samples")]


def polls_unevenly(step: FloatArray, period: float) -> bool:
    """Return whether the long steps, s, are no multiples of a period: a host that polls as it can.

    A steady clock that lost samples leaves steps as near to a multiple as its others are to one period.
    """
    long = step > _GAP * period
    if np.count_nonzero(long) < max(_AROUND, _OFTEN * len(step)):
        return False
    off = np.abs(step / period - np.rint(step / period))
    usual = 0.0 if long.all() else float(np.median(off[~long]))
    return float(np.median(off[long])) > max(_NO_MULTIPLE, _TIMES * usual)


def _ticks(step: FloatArray, period: float) -> FloatArray:
    """Return at which tick of a steady clock each sample was taken, counted along the record.

    The clock follows the stamps slowly: jitter is made up for by the next samples, a gap is not.
    """
    tick, behind = 0, 0.0
    ticks = [0]
    for places in (step / period).tolist():
        passed = round(behind + places)
        behind = (1.0 - _FOLLOW) * (behind + places - passed)
        tick += passed
        ticks.append(tick)
    return np.array(ticks, np.float64)
