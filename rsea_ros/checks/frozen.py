"""Frozen samples: a sensor that repeats a value, or a position that stands, while the machine moves."""

import math
from collections.abc import Collection

import numpy as np

from rsea_ros.checks import expected as expectation
from rsea_ros.identification.noise import step_of
from rsea_ros.records.record import COMMANDS, MEASURED, BoolArray, Channel, FloatArray, Record
from rsea_ros.records.statistics import running_integral, runs_of

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
    if name in COMMANDS:
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
    return np.asarray(length[number] > max(_LONG_RUN * usual, least))


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
        turned, least = _turned(record)
        far = np.zeros(len(suspect), bool)
        for first, end in runs_of(suspect):
            far[first:end] = np.ptp(turned[first:end]) > least
        suspect = suspect & far
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


def _turned(record: Record) -> tuple[FloatArray, float]:
    """Return the angle that the velocity turned by each sample of the position, and the least that counts."""
    velocity, position = record["velocity"], record["position"]
    speed = np.interp(position.t, velocity.t, velocity.y)
    turned = running_integral(speed, position.t)
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
    for first, end in runs_of(held):
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
    for first, end in runs_of(suspect):
        span = velocity.t[[first, end - 1]]
        expected = float(velocity.y[first] * np.ptp(span))
        turned = float(np.diff(np.interp(span, position.t, position.y))[0])
        steady[first:end] = expected != 0.0 and abs(turned - expected) < _STEADY * abs(expected)
    return steady


def _mostly(suspect: BoolArray, clearly: BoolArray, share: float = _MOVED) -> BoolArray:
    """Return the suspect samples if enough of them fall into motion, else none."""
    enough = suspect.any() and clearly[suspect].mean() > share
    return suspect if enough else np.zeros(len(suspect), bool)


def _motion(record: Record, name: str, suspect: BoolArray, kind: str) -> expectation.MotionBeside | None:
    """Return how the best witness moved at the samples of a channel, None without a witness.

    Sensors that are held with the channel are no witnesses. Where none is left, the command speaks for a
    motion only if the noise of one of them would have shown at standstill.
    """
    if kind != "frozen_samples":
        return _both_moved(record, name, expectation.witness_of(record, name))
    long = suspect & in_long_runs(suspect, record[name].rate)
    at = record[name].t[long if long.any() else suspect]  # a quantum repeats values by chance
    held = {n for n in record.channels if n != "command" and _is_held(record[n], at)}
    witness = expectation.witness_of(record, name, but=held - {name})
    others = expectation.witness_of(record, name)
    alone = others != witness and witness in (None, "command", "motor_torque")
    shown = not alone or any(_dithers(record[n]) for n in held)
    return _both_moved(record, name, witness if shown else others, held - {name})


def _both_moved(
    record: Record, name: str, witness: str | None, but: Collection[str] = ()
) -> expectation.MotionBeside | None:
    """Return how a witness moved, where another one did too: a dead sensor moves by its noise.

    A sensor's own noise, which would change its value at standstill, is a second witness.
    """
    first = expectation.motion_beside(record, name, witness)
    others = [n for n in expectation.WITNESSES[name] if n in record and n not in but and n != witness]
    beside = [m for n in others if (m := expectation.motion_beside(record, name, n)) is not None]
    if first is None or not beside or _dithers(record[name]):
        return first
    return expectation.MotionBeside(first.moved & np.any([m.moved for m in beside], axis=0), first.speed)


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
    first, end = max(runs_of(marked), key=lambda run: run[1] - run[0], default=(0, 1))
    begin, stop = channel.t[[first, end - 1]] if len(channel) else (0.0, 0.0)
    if stop - begin < _LONGEST_RUN:
        return ""
    return f"at {channel.y[first]:.4g} from {begin:.4g} s to {stop:.4g} s"
