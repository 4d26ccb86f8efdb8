"""Stamps out of order, and gaps between them.

Samples that only arrived out of order are sorted. A clock that jumped back mixes the samples after the jump
with those before it. The two are distinguished by density: late samples are never denser in time than the
ticks of the clock.
"""

from bisect import bisect_right

import numpy as np

from rsea_ros.records.record import BoolArray, Channel, Fault, FloatArray, IntArray

AROUND = 8
"""Samples on either side of a gap or a jump that say whether it lasts."""
_PLACES, _NO_GAP, _OUTSIDE = 2, 1.4, 10.0
"""A sample more places out of order than this is stray where those around it leave no gap, in periods, or
where it lies so many periods outside the run."""
_MANY_BACK = 0.02
"""Share of the steps: where more go back it is disorder, and steps in order of arrival say little."""
_MOST_JUMPS = 200
"""Steps back that are looked at, the longest first: no clock is set more often in a run."""
LONGEST_PAUSE = 600.0
"""Seconds: as long as a long run. Whoever lays a grid over the record goes through its pauses too; a longer
one is taken for a clock that was set."""
LONGEST_PAUSE_NS = LONGEST_PAUSE * 1e9
_FEW = 0.01
"""Share of a channel's samples that lie far from all others: they are stray, not the run."""


def in_order(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Return a channel sorted by its stamps, without stamps that fit nowhere, and its faults.

    A channel whose clock jumped back is returned unchanged: sorting would mix its samples.
    """
    return (channel, []) if jumps_back(channel.t).any() else sort_by_stamp(channel, name)


def sort_by_stamp(channel: Channel, name: str, keep: bool = False) -> tuple[Channel, list[Fault]]:
    """Return a channel sorted by its stamps, without stamps that fit nowhere, and its faults.

    keep: leave those in too.
    """
    if not np.any(np.diff(channel.t) < 0.0):
        return channel, []
    late = _out_of_order(channel.t)
    stray = _stray(channel.t, late) & (not keep)
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
    period = median_period(t)
    at = np.zeros(len(step), bool)
    candidates = np.flatnonzero(step < -0.5 * period)
    if not len(candidates) or period <= 0.0:
        return at
    lowest = np.minimum.accumulate(t)
    highest = np.maximum.accumulate(t[::-1])[::-1]
    for k in candidates[np.argsort(step[candidates], kind="stable")][:_MOST_JUMPS]:
        apart = highest[k + 1] < lowest[k] and min(k + 1, len(t) - k - 1) > AROUND
        at[k] = apart or _mixes(t, int(k), period)
    return at


def _mixes(t: FloatArray, k: int, period: float) -> bool:
    """Return whether the samples after k lie between those before it, rather than where these leave gaps."""
    low, high = float(t[k + 1]), float(t[k])
    around = int(min(len(t), 4.0 * (high - low) / period + 2 * AROUND))
    before = t[max(0, k + 1 - around) : k + 1]
    after = t[k + 1 : k + 1 + around]
    shift = _level(after[:AROUND], period) - _level(before[-AROUND:], period, before=True)
    high = min(high, float(after.max()))
    due = (high - low) / period + 1.0
    within = [int(np.count_nonzero((part >= low) & (part <= high))) for part in (before, after)]
    lasts = within[1] >= min(AROUND // 2, due)
    return shift < -0.75 * period and sum(within) > 1.5 * due and lasts


def _level(t: FloatArray, period: float, *, before: bool = False) -> float:
    """Return where the clock of some samples stands at the step that they begin or end at, s."""
    places = np.arange(len(t)) - (len(t) if before else 0)
    return float(np.median(t - places * period))


def median_period(t: FloatArray) -> float:
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
    period = median_period(kept) or 1.0
    near = np.minimum(np.abs(t[late] - left), np.abs(right - t[late])) / period
    outside = (at == 0) | (at == len(kept))
    unfit = np.where(outside, near > _OUTSIDE, right - left < _NO_GAP * period)
    stray = np.zeros(len(t), bool)
    stray[late] = (np.abs(at - rank[late]) > _PLACES) & unfit
    return stray


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


GAP = 1.6
"""In sample periods: a longer interval is a gap."""
_FOLLOW = 0.2
"""How far the steady clock behind the stamps goes towards each of them."""
_OFTEN = 0.02
"""Share of the steps: where fewer are long, they are accidents and no habit of the host."""
NO_MULTIPLE, _TIMES = 0.15, 3.0
"""In periods: so far off a whole number, and so many times farther than steps of one period are off, the
typical long step is no multiple."""


def dropped_samples(
    channel: Channel, name: str, taken_out: int, pauses: BoolArray | None = None
) -> list[Fault]:
    """Return the fault of missing samples. A rate that is another one from somewhere on loses none.

    taken_out: how many had a stamp that was not theirs. pauses: steps, shape (n - 1,), without lost samples.
    """
    step, period = np.diff(channel.t), local_period(channel.t)
    step = step if pauses is None else np.where(pauses, period, step)
    if not np.any(step > GAP * period) or polls_unevenly(step, period):
        return []
    ticks = _ticks(step, period)
    lost = float(np.median(ticks[-3:] - np.arange(len(ticks))[-3:])) - taken_out
    if lost < 1.0:
        return []
    longest = int(np.argmax(step))
    detail = f"longest gap {step[longest]:.4g} s at {channel.t[longest]:.3f} s"
    return [Fault("dropped_samples", name, lost / (len(channel) + lost), detail, lost, "samples")]


def local_period(t: FloatArray) -> FloatArray:
    """Return the usual step about each step of stamps, s, shape (n - 1,): that of all, or another rate's.

    Another rate is one that lasts: the median of some steps, or of those before or behind them.
    """
    step, around = np.diff(t), 6 * AROUND + 1
    usual = np.full(len(step), np.median(step) if len(step) else 0.0)
    if len(step) < 2 * around or not np.any(step > GAP * usual):
        return usual
    parts = np.array_split(step, len(step) // around)
    medians = np.pad([float(np.median(part)) for part in parts], 1, mode="edge")
    of = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    near = np.stack([medians[of + k] for k in range(3)])
    local = near[np.argmin(np.abs(near - step), axis=0), np.arange(len(step))]
    return np.where(np.maximum(local, usual) > GAP * np.minimum(local, usual), local, usual)


def polls_unevenly(step: FloatArray, period: float | FloatArray) -> bool:
    """Return whether the long steps, s, are no multiples of a period: a host that polls as it can.

    A steady clock that lost samples leaves steps as near to a multiple as its others are to one period.
    """
    long = step > GAP * period
    if np.count_nonzero(long) < max(AROUND, _OFTEN * len(step)):
        return False
    off = np.abs(step / period - np.rint(step / period))
    usual = 0.0 if long.all() else float(np.median(off[~long]))
    return float(np.median(off[long])) > max(NO_MULTIPLE, _TIMES * usual)


def _ticks(step: FloatArray, period: FloatArray) -> FloatArray:
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
