"""Stamps as they can be used: in order, without repeats, on one clock, where all channels cover the record.

For as long as the clock had stepped back by, every channel then has two samples where it has one elsewhere.
Which row is of which time is lost, so these rows are left out; before and behind them the run is whole.

A clock that jumped shifts all the samples after the jump: sorted, they would mix with those before it, so
the jump is removed first. A motor torque that belongs behind the edge of its command goes there.
"""

from collections.abc import Iterator

import numpy as np

from rsea_ros.errors import ChannelError
from rsea_ros.records import holds, stamp_order
from rsea_ros.records.record import COMMANDS, SENSED, BoolArray, Channel, Fault, FloatArray, Record

_FEWEST = 10
"""Samples of a channel: fewer say little of when it started."""
_ABSENT, _ABSENT_PERIODS, _ABSENT_SHARE = 0.5, 10.0, 0.02
"""s, sample periods, and share of the run: as late as that a sensor may start, by the start of a recorder."""
_MOVED = 0.1
"""Of its range in the run: a sensor that changes more before the first command saw a motion."""


def absent_spans(record: Record) -> Iterator[Fault]:
    """Return a fault for each sensor that starts late or ends early, and for commands that do.

    Commands that start after the sensors are usual, the bench runs before its excitation does; they are a
    fault where the machine moved before.
    """
    driving = record.driving
    if driving is None or len(driving) < _FEWEST:
        return
    last = max(float(c.t[-1]) for c in record.channels.values() if len(c))
    for name, channel in record.channels.items():
        if len(channel) < 2:
            continue
        start, stop = (driving.t[0], driving.t[-1]) if channel is not driving else (_first(record), last)
        longest = max(_ABSENT, _ABSENT_PERIODS / channel.rate, _ABSENT_SHARE * float(stop - start))
        late, early = float(channel.t[0] - start), float(stop - channel.t[-1])
        spans = [(late, start, channel.t[0])] if late > longest else []
        spans += [(early, channel.t[-1], stop)] if early > longest else []
        if spans:
            held = ", the last command is held" if channel is driving and early > longest else ""
            lost = sum(length for length, _, _ in spans)
            detail = " and ".join(f"nothing from {a:.4g} s to {b:.4g} s" for _, a, b in spans)
            yield Fault("partly_recorded", name, lost / float(stop - start), detail + held, lost, "s")


def _first(record: Record) -> float:
    """Return when the machine first moved before the commands, s; their start where it did not."""
    driving = record.driving
    assert driving is not None
    start = float(driving.t[0])
    before = [(c, c.between(-np.inf, start)) for c in map(record.channels.get, SENSED) if c is not None]
    moving = [float(b.t[0]) for c, b in before if len(b) >= _FEWEST and _range(b) > _MOVED * _range(c)]
    return min(moving, default=start)


def _range(channel: Channel) -> float:
    """Return the range of the finite values of a channel."""
    y = channel.y[np.isfinite(channel.y)]
    return float(np.ptp(y)) if len(y) else 0.0


_AROUND = 16
"""Samples over which a rate is measured."""
_SHORTEST = 0.5
"""s."""
_DOUBLE = (1.7, 2.3)
"""Times the usual rate, within."""
_APART = 0.2
"""s. So far the spans of two channels may differ at their ends."""
_SAME = 0.25
"""Share of the steps without a change: where more have none, messages came twice."""
_ALTERNATES = 1.5
"""Times the change over two samples that the change over one has where samples of two times alternate."""


def without_mixed_rows(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record without its rows of two times, and their fault."""
    spans = [_doubled_stretch(c) for c in record.channels.values() if len(c) > 4 * _AROUND]
    known = [span for span in spans if span is not None]
    if len(known) < 2 or len(known) < len(spans) or np.ptp(np.array(known), axis=0).max() > _APART:
        return record, []
    begin, end = min(a for a, _ in known), max(b for _, b in known)
    if record.keeps_rows or not any(_alternates(record[n].between(begin, end).y) for n in record.channels):
        return record, []
    left = {
        n: Channel(c.t[keep], c.y[keep])
        for n, c in record.channels.items()
        for keep in [(c.t < begin) | (c.t > end)]
    }
    driving = record.driving or next(iter(record.channels.values()))
    share = float(np.mean((driving.t >= begin) & (driving.t <= end)))
    detail = (
        f"the clock stepped back by {end - begin:.3g} s, and rows of two times are mixed from {begin:.4g} s"
        f" to {end:.4g} s; they are left out"
    )
    return record.with_channels(**left), [Fault("mixed_rows", "command", share, detail, end - begin, "s")]


def _doubled_stretch(channel: Channel) -> tuple[float, float] | None:
    """Return begin and end (s) of the one stretch in which samples come twice as often, or None."""
    t = channel.t
    if np.any(np.diff(t) < 0.0):
        return None
    span = t[_AROUND:] - t[:-_AROUND]
    usual = float(np.quantile(span, 0.75))
    dense = np.flatnonzero(span < 0.75 * usual)
    if not len(dense) or usual <= 0.0:
        return None
    first, last = int(dense[0]), int(dense[-1]) + _AROUND
    length = float(t[last] - t[first])
    times = (last - first) / max(length, 1e-300) * usual / _AROUND
    whole = len(dense) > 0.9 * (dense[-1] - dense[0] + 1)
    same = float(np.mean(np.diff(channel.y[first:last]) == 0.0))
    if length < _SHORTEST or not _DOUBLE[0] < times < _DOUBLE[1] or not whole or same > _SAME:
        return None
    return float(t[first]), float(t[last])


def _alternates(y: FloatArray) -> bool:
    """Return whether neighbours differ more than next neighbours do: values of two times."""
    if len(y) < _AROUND:
        return False
    by_one, by_two = (float(np.nanmedian(np.abs(y[k:] - y[:-k]))) for k in (1, 2))
    return by_one > _ALTERNATES * by_two > 0.0


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
_STEADIER, _RARE = 0.5, 0.05
"""Of the first samples' unsteadiness: what all of them may have whose count is the clock. Share of the
samples that is rather lost than dated by its order."""
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
    channels, taken_out = {}, {}
    for name, channel in record.channels.items():
        channel, jumps = _without_jumps(record, name)
        channel, disorder = stamp_order.sort_by_stamp(channel, name, record.keeps_rows)
        count = len(channel)
        channel, repeats = _without_repeats(channel, name)
        faults += [*jumps, *disorder, *repeats]
        _check_even(channel, f"{record.source}: {name}")
        channels[name] = channel
        if not any(fault.kind == "coarse_stamps" for fault in repeats):  # else what looks like a gap is none
            taken_out[name] = count - len(channel)
    ordered = record.with_channels(**channels)
    stood = np.empty((2, 0)) if mixed else recorder_pauses(ordered)
    for name, count in taken_out.items():
        t = channels[name].t
        pauses = holds.paused_steps(ordered, name) if name in COMMANDS else np.zeros(max(len(t) - 1, 0), bool)
        at = np.searchsorted(t, stood[0], "right") - 1
        pauses[at[(at >= 0) & (at < len(pauses))]] = True
        faults += stamp_order.dropped_samples(channels[name], name, count, pauses)
    repaired, held = holds.without_held_samples(ordered)
    repaired, _ = holds.with_held_commands(repaired)
    repaired, early = holds.behind_the_edge(repaired)
    faults += [*held, *early]
    explained = {fault.channel for fault in record.faults if fault.kind in _EXPLAIN_GAPS}
    new = [fault for fault in faults if fault.kind != "dropped_samples" or fault.channel not in explained]
    new += () if any(fault.kind == "pause" for fault in record.faults) else _pause_faults(stood)
    return repaired, [*new, *(fault for fault in absent_spans(repaired) if fault not in record.faults)]


_PAUSE = 2.0
"""s. A recorder that stalls loses rows for less; whoever stops one and starts it again needs longer."""


def recorder_pauses(record: Record) -> FloatArray:
    """Return begin and end (s) of the times in which no channel has a sample, shape (2, n)."""
    every = np.sort(np.concatenate([np.zeros(0), *(c.t for c in record.channels.values())]))
    periods = [stamp_order.median_period(c.t) for c in record.channels.values() if len(c) > 1]
    long = np.diff(every) > max(_PAUSE, _ABSENT_PERIODS * float(np.median(periods or [0.0])))
    return np.array([every[:-1][long], every[1:][long]])


def _pause_faults(pauses: FloatArray) -> Iterator[Fault]:
    """Yield the fault of a recorder that paused. pauses: begin and end (s), shape (2, n)."""
    lasts = pauses[1] - pauses[0]
    if len(lasts):
        begin, end = pauses[:, int(np.argmax(lasts))]
        more = f" and {len(lasts) - 1} times more" if len(lasts) > 1 else ""
        what = f"nothing recorded from {begin:.4g} s to {end:.4g} s{more}; the simulation begins anew behind"
        yield Fault("pause", "", float("nan"), what, float(lasts.sum()), "s")


def _without_repeats(channel: Channel, name: str) -> tuple[Channel, list[Fault]]:
    """Return a channel without stamps that repeat, and the fault.

    Repeats with other values that fit an even clock are samples between the ticks of a coarse one. Those that
    arrived together keep their order, where all of them make a steadier count than the first of each. All
    others are left out but for the first of each.
    """
    step = np.diff(channel.t)
    least = _REPEAT * float(np.quantile(step[step > 0.0], 0.9)) if np.any(step > 0.0) else 0.0
    repeated = np.diff(channel.t, prepend=-np.inf) <= least
    if not repeated.any():
        return channel, []
    even, share = even_behind_ticks(channel.t), float(repeated.mean())
    first = Channel(channel.t[~repeated], channel.y[~repeated])
    is_new = np.mean(np.diff(channel.y)[repeated[1:]] != 0.0) >= _NEW_VALUES
    steady = share > _RARE and _unsteadiness(channel.t) < _STEADIER * _unsteadiness(first.t)
    if not is_new or (even is None and not steady):
        return first, [Fault("duplicate_stamps", name, share)]
    how = "dated by the even clock that they fit"
    if even is None:
        how = "they arrived together, in their order"
        apart = 2.0 * least * np.arange(len(channel))
        even = np.asarray(np.maximum.accumulate(channel.t - apart) + apart)
    detail = f"{int(repeated.sum())} of {len(even)} stamps repeat: {how}"
    return Channel(even, channel.y), [Fault("coarse_stamps", name, share, detail)]


def _unsteadiness(t: FloatArray) -> float:
    """Return the RMS distance of stamps from the line over their numbers, s."""
    place = np.arange(len(t)) - 0.5 * (len(t) - 1)
    return float(np.std(t - place * float(place @ t) / float(place @ place)))


def _check_even(channel: Channel, where: str) -> None:
    """Raise ChannelError for stamps that nearly all lie together, in far fewer places than their span has.

    This bounds the size of a grid of their period over their span.
    """
    if len(channel) < 3:
        return
    places = float(np.ptp(channel.t)) / stamp_order.median_period(channel.t)
    if places > max(_MOST_PLACES, _MOST_PER_SAMPLE * len(channel)):
        raise ChannelError(
            f"{where}: {len(channel)} stamps, half of them {stamp_order.median_period(channel.t):.3g} s "
            f"apart, over {np.ptp(channel.t):.3g} s, expected even sampling"
        )


def _without_long_pauses(record: Record) -> tuple[Record, list[Fault]]:
    """Leave out few samples far from all others; shorten what is too long a pause of all, or a set clock."""
    faults: list[Fault] = []
    channels = dict(record.channels)
    for name, c in () if record.keeps_rows else record.channels.items():
        if (stray := stamp_order.far_apart(c.t, stamp_order.LONGEST_PAUSE)).any():
            channels[name] = Channel(c.t[~stray], c.y[~stray])
            faults.append(stamp_order.stray_fault(stray, name))
    least = {n: _SHORTEST_JUMP * stamp_order.median_period(c.t) for n, c in channels.items()}
    longest = {n: max(stamp_order.LONGEST_PAUSE, period) for n, period in least.items()}
    pauses = {n: np.abs(np.diff(c.t)) > longest[n] for n, c in channels.items()}
    if all(at.any() for at in pauses.values()):
        for name, at in pauses.items():
            left = 2.0 * max(_PAUSE, 2.0 * max(least.values()))  # still a pause, behind which all begins anew
            channels[name], jump = _shorten_steps(channels[name], name, at, left)
            faults += jump
    return record.with_channels(**channels), faults


def _without_jumps(record: Record, name: str) -> tuple[Channel, list[Fault]]:
    """Take out steps of the clock: those back for good, and one that makes a channel longer than others.

    A channel should last as the command does, the command as the others.
    """
    channel, others = record[name], [n for n in record.channels if n != name]
    if len(channel) < 3:
        return channel, []
    at = stamp_order.jumps_back(channel.t)
    step, period = np.diff(channel.t), stamp_order.median_period(channel.t)
    known = ["command"] if "command" in others and len(record["command"]) > 1 else others
    spans = {(len(record[n]), float(np.ptp(record[n].t))) for n in known if len(record[n]) > 1}
    expected = float(np.median([span for _, span in spans])) if spans else 0.0
    surplus, largest = float(channel.t[-1] - channel.t[0]) - expected, int(np.argmax(step))
    beside = record["command" if "command" in others else (others or [name])[0]].t
    if (
        expected
        and step[largest] > _SHORTEST_JUMP * period
        and abs(step[largest] - period - surplus) < 2.0 * period
        and not _is_shared(channel.t[largest : largest + 2], beside)
    ):
        at[largest] = True
    return _shorten_steps(channel, name, at) if at.any() else (channel, [])


def _is_shared(step: FloatArray, t: FloatArray) -> bool:
    """Return whether a channel with stamps t pauses in the middle half of a step (begin and end, s), too."""
    begin, end = np.interp((0.25, 0.75), (0.0, 1.0), step)
    long = np.diff(t) > _SHORTEST_JUMP * stamp_order.median_period(t)
    return len(t) > 2 and bool(np.any(long & (t[:-1] <= begin) & (t[1:] >= end)))


def _shorten_steps(c: Channel, name: str, at: BoolArray, left: float = 0.0) -> tuple[Channel, list[Fault]]:
    """Return a channel with each step of `at` as long as a period, or as `left` (s), and the fault."""
    step, left = np.diff(c.t), max(left, stamp_order.median_period(c.t))
    shift = np.concatenate([[0.0], np.cumsum(np.where(at, step - left, 0.0))])
    first, largest = int(np.argmax(at)), float(np.abs(shift).max())
    share, detail = 1.0 - (first + 1) / len(c.t), f"{largest:.4g} s at {c.t[first]:.3f} s"
    return Channel(c.t - shift, c.y), [Fault("clock_jump", name, share, detail, largest, "s")]
