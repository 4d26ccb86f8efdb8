"""Faults of the data, found before any physics, reported and masked: one function a kind.

Each takes a channel and returns which samples are bad, shape (n,). A sample that is masked is never fitted.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsea_ros.checks import frozen as freezes
from rsea_ros.checks.expected import Side, is_commanded, is_still, quotient, sides
from rsea_ros.checks.pairs import Pair, each_pair, pairs_of
from rsea_ros.checks.stamp_findings import rounded_stamps
from rsea_ros.identification.noise import FEW, step_of
from rsea_ros.model.extent import is_too_fast
from rsea_ros.model.rig import Rig
from rsea_ros.records.holds import repeats_of
from rsea_ros.records.record import COMMANDS, MEASURED, BoolArray, Channel, Fault, FloatArray, Record
from rsea_ros.records.stamps import repair_stamps

_VISIBLE = 3.0
"""Times the sensor's noise: a smaller signal than that may well be lost in it."""
_LINKED, _NOTHING = 0.5, 0.2
"""Coherence by power of channels that measure one machine, and of two that share nothing but chance."""
_SHOWS = 0.3
"""Of the channel's RMS: a predicted signal so large would show in it, whatever else is in the channel."""


def dead_channels(
    record: Record,
    compared: Mapping[str, Side],
    rig: Rig,
    frozen: Collection[str] = (),
    pairs: Iterable[Pair] | None = None,
) -> list[Fault]:
    """Return a fault for every sensor that does not measure. record: finite values, rising stamps.

    A channel is dead where it has nothing in common with any other and two others have much in common, or
    where every one is white noise.
    compared: the record beside the rig's simulation: where the signal that it predicts is below the noise, no
    sensor is called dead. frozen: channels of which a part is held, which says why they have little to do
    with the others. pairs: of the record, where they are known.
    """
    if not is_commanded(record):
        return []
    constant = {n: _constant(record[n], n, compared.get(n), rig) for n in record.channels if n in MEASURED}
    doubtful = {n for n, detail in constant.items() if not detail and n not in frozen}
    known: list[Pair] = []
    for pair in each_pair(record, rig) if pairs is None else pairs:
        known.append(pair)
        if not (pair.unrelated or pair.coherence < _NOTHING):
            doubtful -= {pair.law.x, pair.law.y}
        if not doubtful:  # the first laws tie all channels of a sound record
            break
    nothing_moves = is_still(record)
    linked = {n for p in known if p.coherence > _LINKED and not p.unrelated for n in (p.law.x, p.law.y)}
    for n in (n for n in constant if n in doubtful):
        alone = any(n in (p.law.x, p.law.y) and (p.coherence or p.unrelated) for p in known)
        alone = alone and (len(linked - {n}) > 1 or (not linked and nothing_moves))
        if alone and _shows(n, compared.get(n), rig) and not _is_heard(record, n):
            constant[n] = "noise that has nothing to do with the other channels"
    return [Fault("dead_channel", n, 1.0, detail) for n, detail in constant.items() if detail]


def _is_heard(record: Record, name: str) -> bool:
    """Return whether what a channel shows is shown by another, too, line by line of its own power.

    A load that moves passes little of a torque on; weighed by the torque's power, both have little in common.
    """
    t, y = record[name].t, record[name].y
    beside = (np.interp(t, c.t, c.y) for n, c in record.channels.items() if n != name)
    quotients = (quotient(name, t, other, y) for other in beside)
    return any(q is not None and q.related > _LINKED and not q.is_unrelated for q in quotients)


def _shows(name: str, side: Side | None, rig: Rig) -> bool:
    """Return whether the signal that the rig would give is large enough to be seen in a channel."""
    if side is None:
        return True
    predicted = float(np.std(side.p))
    return predicted > max(_SHOWS * float(np.std(side.y)), _VISIBLE * _noise(rig, name))


def _constant(channel: Channel, name: str, side: Side | None, rig: Rig) -> str:
    """Return the fault of a channel that holds one value although its signal must have changed."""
    if len(channel) < 2 or float(np.ptp(channel.y)) > 0.0:
        return ""
    if side is not None and float(np.std(side.p)) < _VISIBLE * _noise(rig, name):
        return ""
    return f"constant at {channel.y[0]:.4g}"


def _noise(rig: Rig, name: str) -> float:
    sensor = rig.sensors.get(name)
    return max(sensor.noise, sensor.quantum) if sensor else 0.0


_AROUND = 10
_SPIKE = 12.0
"""A sample further than this many spreads of the ten around it from their median is an outlier."""
_CLIPPED = 8
"""As many samples at exactly the largest value, some of them in a row, are clipping."""
_SLOWLY = 0.1
"""Of the usual step from sample to sample: a motion that ends, not one that a limit cuts off."""
_FEWEST_COMMANDS = 10
"""Commands, with which a record can still be simulated."""
_COARSE = 5.0
"""Steps larger than this multiple of those of the rig's sensor are reported."""


@dataclass(frozen=True)
class Checked:
    """A record with its faults: finite, rising stamps; and which samples must not count, by channel.

    compared: the record beside the rig's simulation, where nothing was masked or left out; None elsewhere.
    measured: what its channels are compared in, and with which rig; None for a record of no commands.
    """

    record: Record
    masked: Mapping[str, BoolArray]
    faults: tuple[Fault, ...]
    compared: Mapping[str, Side] | None = None
    measured: tuple[Record, Rig] | None = None

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """What its channels say of each other."""
        return pairs_of(*self.measured) if self.measured is not None else ()


def check(record: Record, rig: Rig) -> Checked:
    """Find and mask the faults of a record; a channel of one sample, or without a good one, is missing."""
    rig = rig.under(record.source)
    few = {n: 1 if n in COMMANDS else 2 for n in record.channels}
    record = _without(record, {n for n, c in record.channels.items() if len(c) < few[n]})
    faults = [*record.faults, *(Fault("missing_topic", n, 1.0) for n in rig.sensors if n not in record)]
    repaired, clock_faults = repair_stamps(record)
    faults += [f for n, c in repaired.channels.items() for f in rounded_stamps(c, n)]
    masked, marked = {}, {}
    for name in repaired.channels:
        masked[name], marked[name] = _mask(repaired, name)
    frozen_ones = {n for n, marks in marked.items() if any(f.kind == "frozen_samples" for f in marks)}
    finite = {n: not_finite(c, n) for n, c in repaired.channels.items()}
    filled = _fill(repaired, finite)
    compared = sides(filled, rig) if is_commanded(filled) else {}
    measured = (filled, rig) if is_commanded(filled) and not is_too_fast(filled) else None
    dead = dead_channels(filled, compared, rig, frozen_ones, None if measured else ())
    repaired = _without(repaired, {f.channel for f in dead})
    known = {(f.kind, f.channel) for f in faults}
    faults += [*clock_faults, *(f for f in dead if (f.kind, f.channel) not in known)]
    faults += [f for n in repaired.channels for f in marked[n]]
    masked = {n: bad for n, bad in masked.items() if n in repaired}
    faults += [f for n in rig.sensors if _has_steps(repaired, n) for f in coarse(repaired[n], n, rig)]
    repaired, masked = _without_unknown_commands(repaired, masked)
    alive = _without(repaired, {n for n, bad in masked.items() if bad.all() and n != "command"})
    whole = not dead and not any(bad.any() for bad in masked.values())
    return Checked(_fill(alive, masked), masked, tuple(faults), compared if whole else None, measured)


def _without_unknown_commands(
    record: Record, masked: Mapping[str, BoolArray]
) -> tuple[Record, dict[str, BoolArray]]:
    """Return record and masks without the commands that are no numbers: lost ones, which no line replaces."""
    masked, command = dict(masked), record.channels.get("command")
    known = np.isfinite(command.y) if command is not None else np.zeros(0, bool)
    if command is None or known.all() or np.count_nonzero(known) < _FEWEST_COMMANDS:
        return record, masked
    masked["command"] = masked["command"][known]
    return record.with_channels(command=Channel(command.t[known], command.y[known])), masked


def _has_steps(record: Record, name: str) -> bool:
    """Return whether the steps of a channel are those of its sensor, not of a command of few values."""
    if name != "motor_torque" or "command" not in record:
        return name in record
    return name in record and len(np.unique(record["command"].y)) > FEW * len(record["command"])


def _mask(record: Record, name: str) -> tuple[BoolArray, list[Fault]]:
    """Return which samples of a channel must not count, and its faults."""
    channel, faults = record[name], []
    bad = np.zeros(len(channel), bool)
    for kind, find in FINDERS.items():
        if kind in _WHILE_MOVING and not is_commanded(record):
            continue
        marked = find(channel, name) & ~bad
        if kind in _WHILE_MOVING:
            marked = freezes.while_others_moved(record, name, marked, kind)
        if kind == "frozen_samples":
            marked |= freezes.simultaneous_holds(record, name) & ~bad
            marked |= freezes.held_in_motion(record) & ~bad if name == "position" else False
        share = np.count_nonzero(marked) / max(len(marked), 1)
        if share > (freezes.SMALLEST_SHARE if kind == "frozen_samples" else 0.0):
            where = freezes.longest(channel, marked) if kind == "frozen_samples" else ""
            faults.append(Fault(kind, name, share, where))
            bad |= marked
    return bad, faults


def _without(record: Record, names: Collection[str]) -> Record:
    return replace(record, channels={n: c for n, c in record.channels.items() if n not in names})


def coarse(channel: Channel, name: str, rig: Rig) -> list[Fault]:
    """Return the fault of a sensor whose values come in much larger steps than the rig's sensor makes.

    Nothing is masked: such a sensor is noisy, not wrong.
    """
    step, sensor = step_of(channel.y), rig.sensors[name]
    stated = max(sensor.quantum, sensor.noise)
    if step == 0.0 or step < _COARSE * stated:
        return []
    return [Fault("coarse_steps", name, 1.0, f"steps of {step:.3g} where the rig's sensor has {stated:.3g}")]


def not_finite(channel: Channel, name: str) -> BoolArray:
    """Return which values are NaN or infinite."""
    return ~np.isfinite(channel.y)


def outliers(channel: Channel, name: str) -> BoolArray:
    """Return which samples stand alone: far from the median of the ten around them, which agree.

    Their spread is the third largest distance, so that two outliers may be neighbours; the
    first sample after a step of the torque has more neighbours that are like it.
    """
    if name == "command" or len(channel) < 2 * _AROUND or not np.isfinite(channel.y).any():
        return np.zeros(len(channel), bool)
    padded = np.pad(
        np.nan_to_num(channel.y, nan=float(np.nanmedian(channel.y))), _AROUND // 2, mode="reflect"
    )
    around = np.delete(np.lib.stride_tricks.sliding_window_view(padded, _AROUND + 1), _AROUND // 2, axis=1)
    around = np.sort(around, axis=1)
    middle = 0.5 * (around[:, _AROUND // 2 - 1] + around[:, _AROUND // 2])
    spread = np.partition(np.abs(around - middle[:, None]), _AROUND - 3, axis=1)[:, _AROUND - 3]
    steps = np.abs(np.diff(channel.y))
    least = float(np.nanmedian(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    alone = (channel.y > around[:, -3]) | (channel.y < around[:, 2])
    return np.asarray(alone & (np.abs(channel.y - middle) > _SPIKE * np.maximum(spread, least)))


def clipping(channel: Channel, name: str) -> BoolArray:
    """Return which samples lie at exactly the largest or smallest value, where many do in a row.

    Of a log that repeats each value, the values count. A motion that slows down to the extreme value rests.
    """
    bad = np.zeros(len(channel), bool)
    if name in (*COMMANDS, "motor_torque") or not np.isfinite(channel.y).any():
        return bad
    arrived = channel.y[:: repeats_of(channel.y)]
    for extreme in (np.nanmax(channel.y), np.nanmin(channel.y)):
        at = arrived == extreme
        in_a_row = at[1:] & at[:-1]
        many = at.sum() >= _CLIPPED and in_a_row.sum() >= _CLIPPED // 2
        if many and not _common(arrived, float(extreme)) and not _rests(arrived, at):
            bad |= channel.y == extreme
    return bad


def _rests(y: FloatArray, at: BoolArray) -> bool:
    """Return whether a channel comes to some values, or leaves them, far slower than it moves elsewhere."""
    step = np.nan_to_num(np.abs(np.diff(y)))
    edges = [step[at[1:] & ~at[:-1]], step[at[:-1] & ~at[1:]]]
    moving = step[step > 0.0]
    if not len(moving) or not all(map(len, edges)):
        return False
    clear = moving[moving > 1.5 * moving.min()]
    usual = float(np.median(clear)) if len(clear) else 0.0
    slow = max(1.5 * float(moving.min()), _SLOWLY * usual)
    return bool(min(map(np.median, edges)) <= slow < usual)


def _common(y: FloatArray, extreme: float) -> bool:
    """Return whether values just inside the extreme are as common as the extreme (a coarse quantum)."""
    values, counts = np.unique(y[np.isfinite(y)], return_counts=True)
    k = int(np.argmin(np.abs(values - extreme)))
    inside = counts[max(k - 3, 0) : k] if k > len(values) // 2 else counts[k + 1 : k + 4]
    return bool(counts[k] < 4 * max(int(inside.max(initial=0)), 1))


_WHILE_MOVING = ("clipping", "frozen_samples")

FINDERS: Mapping[str, Callable[[Channel, str], BoolArray]] = {
    "nan": not_finite,
    "clipping": clipping,
    "frozen_samples": freezes.frozen_samples,
    "outliers": outliers,
}


def _fill(record: Record, masked: Mapping[str, BoolArray]) -> Record:
    """Return the record with bad values bridged by straight lines, so that a simulation can run."""
    channels = {}
    for name, channel in record.channels.items():
        good = ~masked[name] & np.isfinite(channel.y)
        bridged = np.interp(channel.t, channel.t[good], channel.y[good]) if good.any() else 0.0
        channels[name] = Channel(channel.t, np.where(good, channel.y, bridged))
    return record.with_channels(**channels)
