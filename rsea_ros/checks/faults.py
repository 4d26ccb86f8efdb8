"""Faults of the data, found before any physics, reported and masked: one function a kind.

Each takes a channel and returns which samples are bad, shape (n,). A sample that is masked is never fitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.expected import (
    WITNESSES,
    MotionBeside,
    Side,
    is_commanded,
    is_still,
    motion_beside,
    sides,
    witness_of,
)
from rsea_ros.checks.pairs import Pair, pairs_of
from rsea_ros.checks.stamp_findings import rounded_stamps
from rsea_ros.identification.noise import FEW, step_of
from rsea_ros.model.extent import is_too_fast
from rsea_ros.model.rig import Rig
from rsea_ros.records.holds import repeats_of
from rsea_ros.records.record import MEASURED, BoolArray, Channel, Fault, FloatArray, Record
from rsea_ros.records.stamps import repair_stamps

SMALLEST_SHARE = 1e-3
"""Of a channel's samples: fewer repeats are no fault."""
_SLOW = 0.25
"""Of the samples: a sensor that repeats more of them is slower than the log."""
_COARSE_STEPS = 0.5
"""Share of the changes that are by one quantum: a sensor that skipped samples would catch up by several."""
_MOVED = 0.3
"""Share of the suspect samples that must fall into motion; a sensor that freezes at any time reaches more."""
_MOVED_OF_NOISY = 0.1
"""The same for long runs of a sensor whose noise would change its value even at standstill."""
_COMMANDED = 0.8
"""Of a run that two sensors hold: the share in which the command changes; at rest it does not."""
_STEADY = 0.1
"""Of the turned angle: a velocity and a position that agree so well both measure a steady speed."""
_STEPS_AT_REST = 4.0
"""Steps of a position within which the integral of a noisy velocity stays while the joint rests."""
_FEWEST_HELD = 5
"""Samples that a position repeats, at least, to have missed a motion: fewer are alike by its steps."""
_MADE = 0.3
"""Of the turned angle: a jump that agrees so well is of the motion that a position missed while it froze."""
_LONG_RUN = 20.0
"""Times the usual run of equal values: a longer one is no slow sensor."""
_LONGEST_RUN = 0.5
"""s. No coarse quantum holds a value so long while the machine moves."""
_HELD = 0.95
"""Share of the samples: a channel that repeats so many is held; a coarse one in motion repeats fewer."""
_DITHER = 0.5
"""Of the step between values: noise above it changes the value at standstill too; a step alone has 0.3."""
_NONE = 1e-5
"""Of a signal's RMS: no sensor has less noise, a simulation without noise has none."""
_QUIETEST = 0.1
"""Quantile of the noise of stretches of the record: in the quietest, motion adds least to it."""
_STRETCH = 32
"""Samples of a stretch, enough for the median of their fourth differences."""


def frozen_samples(channel: Channel, name: str) -> BoolArray:
    """Return which samples repeat the one before more often than a quantum explains.

    With a quantum, neighbouring values may be equal by chance; then as many differ by one quantum, plus or
    minus three standard deviations. Where most values that change do so by one quantum, the quantum explains
    all but long runs. A sensor that repeats every other sample or more is slower than the log,
    which is no fault; but a few runs far longer than all others are.
    """
    if name in ("command", "reference"):
        return np.zeros(len(channel), bool)
    step = np.diff(channel.y, prepend=np.nan)
    repeat: BoolArray = step == 0.0
    moving = np.abs(step[np.isfinite(step) & ~repeat])
    if not len(moving):
        return repeat
    by_one = moving < 1.5 * float(moving.min())
    if by_one.mean() > _COARSE_STEPS:
        return repeat & in_long_runs(repeat, channel.rate)
    by_chance = float(by_one.sum()) / 2.0
    surplus = float(repeat.sum()) - 1.5 * by_chance - 3.0 * float(np.sqrt(repeat.sum()))
    is_fault = max(5.0, SMALLEST_SHARE * len(channel)) < surplus < _SLOW * len(channel)
    return repeat if is_fault else repeat & in_long_runs(repeat, channel.rate)


def in_long_runs(repeat: BoolArray, rate: float) -> BoolArray:
    """Return which samples lie in a run of repeats far longer than the usual one. rate: Hz."""
    return _in_runs(repeat, _LONGEST_RUN * rate)


def _in_runs(repeat: BoolArray, least: float) -> BoolArray:
    """Return which samples lie in a run of repeats far longer than the usual one and than some samples."""
    number = np.cumsum(~repeat)
    length = np.bincount(number)
    usual = float(np.quantile(length[length > 0], 0.95))
    long: BoolArray = length[number] > max(_LONG_RUN * usual, least)
    return long


def simultaneous_holds(record: Record, name: str) -> BoolArray:
    """Return the samples at which a sensor and another one hold their values while the command changes.

    Both have noise, which never holds two sensors at once, so nothing need have moved.
    """
    channel, driving = record[name], record.driving
    held = _held_runs(record, name)
    if not held.any() or driving is None:
        return np.zeros(len(held), bool)
    changes = np.diff(driving.y, append=driving.y[-1:]) != 0.0
    commanded = changes[np.clip(np.searchsorted(driving.t, channel.t, side="right") - 1, 0, len(changes) - 1)]
    run = np.cumsum(np.diff(held, prepend=False) & held)
    share = np.bincount(run[held], commanded[held]) / np.maximum(np.bincount(run[held]), 1)
    held = held & (share[np.minimum(run, len(share) - 1)] > _COMMANDED)
    together = np.zeros(len(channel), bool)
    for other in (n for n in MEASURED if n in record and n != name):
        runs = _held_runs(record, other)
        nearest = np.clip(np.searchsorted(record[other].t, channel.t), 0, len(runs) - 1)
        together |= runs[nearest]
    return held & together


def _held_runs(record: Record, name: str) -> BoolArray:
    """Return the long runs of repeats of a sensor with noise; none for any other channel."""
    channel = record[name]
    repeat: BoolArray = np.diff(channel.y, prepend=np.nan) == 0.0
    runs = _in_runs(repeat, _LONG_RUN) if name in MEASURED and repeat.any() else np.zeros(len(repeat), bool)
    return runs & repeat if runs.any() and _dithers(channel) else np.zeros(len(repeat), bool)


def while_others_moved(record: Record, name: str, suspect: BoolArray, kind: str) -> BoolArray:
    """Return the suspect samples, none if the machine mostly stood still then.

    A sensor that holds a value while nothing moves is sound: at rest, at a limit of the torque, stuck. One
    that freezes does so in fast and in slow motion alike, a coarse one rather in slow motion.
    """
    if name == "position" and "velocity" in record:
        suspect = suspect & _went_on(record, suspect)
    motion = _motion(record, name, suspect, kind) if suspect.any() else None
    if motion is None or not motion.moved.any():
        return suspect if motion is None else np.zeros(len(suspect), bool)
    if kind != "frozen_samples":
        return _mostly(suspect, motion.moved)
    if name == "velocity" and "position" in record:
        suspect = suspect & ~_at_steady_speed(record, suspect)
    long = suspect & in_long_runs(suspect, record[name].rate)
    fast = motion.moved & (motion.speed > np.median(motion.speed[motion.moved]))
    share = _MOVED_OF_NOISY if long.any() and _dithers(record[name]) else _MOVED
    return _mostly(long, motion.moved, share) | _mostly(suspect & ~long, fast)


def _runs(marked: BoolArray) -> list[tuple[int, int]]:
    """Return first and end (exclusive) of each run of marked samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _went_on(record: Record, suspect: BoolArray) -> BoolArray:
    """Return the samples of runs in which the velocity turned further than a few steps of the position."""
    turned, least = _turned(record)
    far = np.zeros(len(suspect), bool)
    for first, end in _runs(suspect):
        far[first:end] = np.ptp(turned[first:end]) > least
    return far


def _turned(record: Record) -> tuple[FloatArray, float]:
    """Return the angle that the velocity turned by each sample of the position, and the least that counts."""
    velocity, position = record["velocity"], record["position"]
    speed = np.interp(position.t, velocity.t, velocity.y)
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(position.t))])
    steps = np.abs(np.diff(position.y))
    return turned, _STEPS_AT_REST * float(np.min(steps[steps > 0.0], initial=np.inf))


def held_in_motion(record: Record) -> BoolArray:
    """Return the samples of the position that repeat while the velocity makes the jump that ends the run."""
    position = record["position"]
    held: BoolArray = np.diff(position.y, prepend=np.nan) == 0.0
    marked = np.zeros(len(held), bool)
    if "velocity" not in record or not held.any():
        return marked
    turned, least = _turned(record)
    for first, end in _runs(held):
        if end < len(held) and end - first >= _FEWEST_HELD:
            held_back, made = turned[[end - 1, end]] - turned[first - 1]
            jump = position.y[end] - position.y[first - 1]
            went_on = abs(held_back) > max(least, 0.5 * abs(made))  # a joint at rest moves in the last step
            marked[first:end] = went_on and abs(jump - made) < _MADE * abs(made)
    return marked if marked.mean() < _SLOW else np.zeros(len(held), bool)


def _at_steady_speed(record: Record, suspect: BoolArray) -> BoolArray:
    """Return the samples of runs in which the position turned as the held velocity says."""
    velocity, position = record["velocity"], record["position"]
    steady = np.zeros(len(suspect), bool)
    for first, end in _runs(suspect):
        span = velocity.t[[first, end - 1]]
        expected = float(velocity.y[first] * np.ptp(span))
        turned = float(np.diff(np.interp(span, position.t, position.y))[0])
        steady[first:end] = expected != 0.0 and abs(turned - expected) < _STEADY * abs(expected)
    return steady


def _mostly(suspect: BoolArray, clearly: BoolArray, share: float = _MOVED) -> BoolArray:
    """Return the suspect samples if enough of them fall into motion, else none."""
    enough = suspect.any() and clearly[suspect].mean() > share
    return suspect if enough else np.zeros(len(suspect), bool)


def _motion(record: Record, name: str, suspect: BoolArray, kind: str) -> MotionBeside | None:
    """Return how the best witness moved at the samples of a channel, None without a witness.

    Sensors that are held with the channel are no witnesses. Where none is left, the command speaks for a
    motion only if the noise of one of them would have shown at standstill.
    """
    if kind != "frozen_samples":
        return _both_moved(record, name, witness_of(record, name))
    long = suspect & in_long_runs(suspect, record[name].rate)
    at = record[name].t[long if long.any() else suspect]  # a quantum repeats values by chance
    held = {n for n in record.channels if n != "command" and _is_held(record[n], at)}
    witness = witness_of(record, name, but=held - {name})
    others = witness_of(record, name)
    alone = others != witness and witness in (None, "command", "motor_torque")
    shown = not alone or any(_dithers(record[n]) for n in held)
    return _both_moved(record, name, witness if shown else others, held - {name})


def _both_moved(
    record: Record, name: str, witness: str | None, but: Collection[str] = ()
) -> MotionBeside | None:
    """Return how a witness moved, where another one did too: a dead sensor moves by its noise.

    A sensor's own noise, which would change its value at standstill, is a second witness.
    """
    first = motion_beside(record, name, witness)
    others = [n for n in WITNESSES[name] if n in record and n not in but and n != witness]
    beside = [m for n in others if (m := motion_beside(record, name, n)) is not None]
    if first is None or not beside or _dithers(record[name]):
        return first
    return MotionBeside(first.moved & np.any([m.moved for m in beside], axis=0), first.speed)


def _is_held(channel: Channel, at: FloatArray) -> bool:
    """Return whether a channel repeats its value at nearly all of some times, s."""
    repeats = np.diff(channel.y, prepend=np.nan) == 0.0
    nearest = np.clip(np.searchsorted(channel.t, at), 0, len(channel) - 1)
    return bool(np.mean(repeats[nearest]) > _HELD)


def _dithers(channel: Channel) -> bool:
    """Return whether the noise of a sensor is large enough to change its value at standstill."""
    moving = channel.y[np.diff(channel.y, prepend=np.nan) != 0.0]
    size = len(moving) // _STRETCH
    if size < 2:
        return False
    fourth = np.abs(np.diff(moving[: size * _STRETCH].reshape(size, _STRETCH), 4, axis=1))
    white = np.median(fourth, axis=1) / 0.6745 / math.sqrt(70.0)
    least = max(_DITHER * step_of(channel.y), _NONE * float(np.std(moving)))
    return bool(np.quantile(white, _QUIETEST) > least)


def longest(channel: Channel, marked: BoolArray) -> str:
    """Return from when to when the longest run of marked samples lasts, for people; empty for short ones."""
    first, end = max(_runs(marked), key=lambda run: run[1] - run[0], default=(0, 1))
    begin, stop = channel.t[[first, end - 1]] if len(channel) else (0.0, 0.0)
    if stop - begin < _LONGEST_RUN:
        return ""
    return f"at {channel.y[first]:.4g} from {begin:.4g} s to {stop:.4g} s"


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
    pairs: Sequence[Pair] | None = None,
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
    pairs = pairs_of(record, rig) if pairs is None else pairs
    nothing_moves = is_still(record)
    linked = {n for p in pairs if p.coherence > _LINKED and not p.unrelated for n in (p.law.x, p.law.y)}
    for n in constant:
        of = [p for p in pairs if n in (p.law.x, p.law.y) and (p.coherence or p.unrelated)]
        alone = of and all(p.unrelated or p.coherence < _NOTHING for p in of)
        alone = alone and (len(linked - {n}) > 1 or (not linked and nothing_moves))
        if alone and not constant[n] and n not in frozen and _shows(n, compared.get(n), rig):
            constant[n] = "noise that has nothing to do with the other channels"
    return [Fault("dead_channel", n, 1.0, detail) for n, detail in constant.items() if detail]


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
    pairs: what its channels say of each other.
    """

    record: Record
    masked: Mapping[str, BoolArray]
    faults: tuple[Fault, ...]
    compared: Mapping[str, Side] | None = None
    pairs: tuple[Pair, ...] = ()


def check(record: Record, rig: Rig) -> Checked:
    """Find and mask the faults of a record; a channel of one sample, or without a good one, is missing."""
    few = {n: 1 if n in ("command", "reference") else 2 for n in record.channels}
    record = _without(record, {n for n, c in record.channels.items() if len(c) < few[n]})
    faults = [*record.faults, *(Fault("missing_topic", name, 1.0) for name in missing_channels(record, rig))]
    repaired, clock_faults = repair_stamps(record)
    faults += [f for n, c in repaired.channels.items() for f in rounded_stamps(c, n)]
    masked, marked = {}, {}
    for name in repaired.channels:
        masked[name], marked[name] = _mask(repaired, name)
    frozen_ones = {n for n, marks in marked.items() if any(f.kind == "frozen_samples" for f in marks)}
    finite = {n: not_finite(c, n) for n, c in repaired.channels.items()}
    filled = _fill(repaired, finite)
    compared = sides(filled, rig) if is_commanded(filled) else {}
    pairs = pairs_of(filled, rig) if is_commanded(filled) and not is_too_fast(filled) else ()
    dead = dead_channels(filled, compared, rig, frozen_ones, pairs)
    repaired = _without(repaired, {f.channel for f in dead})
    known = {(f.kind, f.channel) for f in faults}
    faults += [*clock_faults, *(f for f in dead if (f.kind, f.channel) not in known)]
    faults += [f for n in repaired.channels for f in marked[n]]
    masked = {n: bad for n, bad in masked.items() if n in repaired}
    faults += [f for n in rig.sensors if _has_steps(repaired, n) for f in coarse(repaired[n], n, rig)]
    repaired, masked = _without_unknown_commands(repaired, masked)
    alive = _without(repaired, {n for n, bad in masked.items() if bad.all() and n != "command"})
    whole = not dead and not any(bad.any() for bad in masked.values())
    return Checked(_fill(alive, masked), masked, tuple(faults), compared if whole else None, pairs)


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
            marked = while_others_moved(record, name, marked, kind)
        if kind == "frozen_samples":
            marked |= simultaneous_holds(record, name) & ~bad
            marked |= held_in_motion(record) & ~bad if name == "position" else False
        share = np.count_nonzero(marked) / max(len(marked), 1)
        if share > (SMALLEST_SHARE if kind == "frozen_samples" else 0.0):
            where = longest(channel, marked) if kind == "frozen_samples" else ""
            faults.append(Fault(kind, name, share, where))
            bad |= marked
    return bad, faults


def _without(record: Record, names: Collection[str]) -> Record:
    return replace(record, channels={n: c for n, c in record.channels.items() if n not in names})


def missing_channels(record: Record, rig: Rig) -> tuple[str, ...]:
    """Return the channels of the rig's sensors that the record lacks."""
    return tuple(n for n in rig.sensors if n not in record)


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
    marked: BoolArray = alone & (np.abs(channel.y - middle) > _SPIKE * np.maximum(spread, least))
    return marked


def clipping(channel: Channel, name: str) -> BoolArray:
    """Return which samples lie at exactly the largest or smallest value, where many do in a row.

    Of a log that repeats each value, the values count. A motion that slows down to the extreme value rests.
    """
    bad = np.zeros(len(channel), bool)
    if name in ("command", "reference", "motor_torque") or not np.isfinite(channel.y).any():
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
    usual = float(np.median(moving[moving > 1.5 * moving.min()])) if np.ptp(moving) > 0.0 else 0.0
    slow = max(1.5 * float(moving.min()), _SLOWLY * usual)
    return bool(min(map(np.median, edges)) <= slow < usual)


def _common(y: FloatArray, extreme: float) -> bool:
    """Return whether values just inside the extreme are as common as the extreme (a coarse quantum)."""
    values, counts = np.unique(y[np.isfinite(y)], return_counts=True)
    k = int(np.argmin(np.abs(values - extreme)))
    inside = (
        counts[max(k - 3, 0) : k].max(initial=0)
        if k > len(values) // 2
        else counts[k + 1 : k + 4].max(initial=0)
    )
    return bool(counts[k] < 4 * max(int(inside), 1))


_WHILE_MOVING = ("clipping", "frozen_samples")

FINDERS: Mapping[str, Callable[[Channel, str], BoolArray]] = {
    "nan": not_finite,
    "clipping": clipping,
    "frozen_samples": frozen_samples,
    "outliers": outliers,
}


def _fill(record: Record, masked: Mapping[str, BoolArray]) -> Record:
    """Return the record with bad values bridged by straight lines, so that a simulation can run."""
    channels = {}
    for name, channel in record.channels.items():
        good = ~masked[name] & np.isfinite(channel.y)
        bridged = (
            np.interp(channel.t, channel.t[good], channel.y[good]) if good.any() else np.zeros(len(channel))
        )
        channels[name] = Channel(channel.t, np.where(good, channel.y, bridged))
    return record.with_channels(**channels)
