"""What drives a simulation: commands held between their stamps, and where it starts anew.

It starts anew behind gaps, on the measured motion: what was commanded meanwhile is unknown. A sensor that
pauses while others go on is no such gap. Nor are commands that pause, which hold until the next one, unless
the measured motor torque shows that others acted.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.errors import IdentificationError
from rsea_ros.model.extent import AS_SECONDS, check_extent, check_slow
from rsea_ros.model.rig import Hold, Rig
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.holds import lost_commands
from rsea_ros.records.record import BoolArray, FloatArray, Record
from rsea_ros.records.statistics import running_integral

AT_REST = 0.5
"""Of the whole record's standard deviation: a first sample below it is of a bench that started from rest."""

LATE = 1.6
"""Sample periods: a first sample later than this after the first command is of a channel that starts late."""


def zero_unknown(record: Record, rig: Rig, channel: str) -> bool:
    """Return whether only the changes of a channel count: by the rig, or for a position that is far off."""
    off = any((f.kind, f.channel) == ("offset", "position") for f in record.faults)
    return rig.zero_unknown(channel) or (channel == "position" and off)


def first_state(record: Record) -> tuple[float, float]:
    """Return the first position and velocity, zero where there is none."""
    position, velocity = (_finite(record, n)[1] for n in ("position", "velocity"))
    return float(position[0]), float(velocity[0])


def initial_state(record: Record) -> tuple[float, float]:
    """Return position and velocity at the start: rest, unless the first samples say otherwise.

    The first sample comes a period after the first command; a motion that the command may have caused until
    then, the largest change from sample to sample, is not an initial motion. A channel that was not measured
    says nothing. The position at the start is the first one less what the first velocity brought until then.
    """
    (t, position), (_, velocity) = (_finite(record, n) for n in ("position", "velocity"))
    if not (_has_moved(position) or _has_moved(velocity)):
        return 0.0, 0.0
    late = float(t[0] - record["command"].t[0])
    passed = late if "position" in record and 0.0 < late < LATE * float(t[1] - t[0]) else 0.0
    return float(position[0] - passed * velocity[0]), float(velocity[0])


def state_at(record: Record, first: float, at: float) -> tuple[float, float]:
    """Return position and velocity at a time (s), from the first samples at or after `first` (s).

    Zero where there is none; a velocity that is not measured is the slope of the position.
    """
    position, velocity = (_from(record, n, first) for n in ("position", "velocity"))
    if velocity is not None:
        v = float(velocity[1][0])
    else:
        v = float(np.diff(position[1][:2])[0] / np.diff(position[0][:2])[0]) if position is not None else 0.0
    return (0.0 if position is None else float(position[1][0] + v * (at - position[0][0]))), v


def _from(record: Record, name: str, first: float) -> tuple[FloatArray, FloatArray] | None:
    """Return stamps and finite values of a channel from a time (s) on, None where fewer than two are left."""
    if name not in record:
        return None
    t, y = record[name].t, record[name].y
    keep = (t >= first) & np.isfinite(y)
    return (t[keep], y[keep]) if np.count_nonzero(keep) > 1 else None


def angle_at(record: Record, ends: FloatArray) -> FloatArray:
    """Return the measured position at some times (s), by cubics where its speed is measured with it."""
    if "position" not in record:
        return np.empty(0)
    t, q = _finite(record, "position")
    if "velocity" in record and len(t) > 1:
        at, v = _finite(record, "velocity")
        if np.array_equal(at, t):
            return np.asarray(_cubics(t, q, v, np.clip(ends, t[0], t[-1])))
    return np.interp(ends, t, q)


def _finite(record: Record, name: str) -> tuple[FloatArray, FloatArray]:
    """Return stamps and values of a channel where it has values; a rest of two samples where it has none."""
    if name in record:
        t, y = record[name].t, record[name].y
        good = np.isfinite(y)
        if np.count_nonzero(good) > 1:
            return t[good], y[good]
    return np.arange(2.0), np.zeros(2)


@njit(cache=True, nogil=True, error_model="numpy")
def _cubics(t, y, slope, at):  # type: ignore[no-untyped-def]
    """Return at some rising times within t the cubics through y that have its slope there (Hermite)."""
    values, k = np.empty(len(at)), 0
    for i in range(len(at)):
        while k < len(t) - 2 and t[k + 1] <= at[i]:
            k += 1
        width = t[k + 1] - t[k]
        u = (at[i] - t[k]) / width
        left, right = u * (1.0 - u) ** 2 * width * slope[k], u**2 * (u - 1.0) * width * slope[k + 1]
        values[i] = y[k] + (y[k + 1] - y[k]) * u**2 * (3.0 - 2.0 * u) + left + right
    return values


def _has_moved(y: FloatArray) -> bool:
    least = max(AT_REST * np.std(y), np.max(np.abs(np.diff(y))))
    return bool(y[0] != 0.0 and abs(y[0]) >= least)


class SpringStart(NamedTuple):
    """What a sensor of the spring shows at a start: F/T torque (N m) or deflection (rad), and its rate."""

    channel: str
    value: float
    rate: float


class LoadStart(NamedTuple):
    """State at a start whose output moves: position (rad), velocity (rad/s), and what the spring shows."""

    position: float
    velocity: float
    spring: SpringStart


Restart = tuple[int, tuple[float, float] | SpringStart | LoadStart]
"""Step of a drive before which it begins anew; position (rad) and velocity (rad/s) there, or the spring, or
both."""


def restarts(record: Record, start: float, step: float, *, from_rest: bool) -> tuple[Restart, ...]:
    """Return where a drive begins anew, behind the commands that were lost, with what is measured there.

    start: s, of its first step; from_rest: it began at angle zero.
    """
    states: list[Restart] = []
    origin = state_at(record, start, start)[0] if from_rest else 0.0
    for end in (end - ON_GRID * step for _, end in lost_commands(record)):
        moves = next((n for n in ("velocity", "position", "deflection", "ft") if _from(record, n, end)), "")
        t, y = _from(record, moves, end) or (np.full(2, end), np.zeros(2))
        rate = float(np.diff(y[:2])[0] / np.diff(t[:2])[0]) if moves else 0.0
        middle = 0.5 * float(t[0] + t[1])  # where the slope is the rate
        k = math.ceil(((end if moves == "velocity" else middle) - start) / step)
        if moves in ("deflection", "ft"):
            states.append((k, SpringStart(moves, 0.5 * float(y[0] + y[1]), rate)))
            continue
        position, velocity = state_at(record, end, start + k * step)
        states.append((k, (position - origin, velocity)))
    return tuple(states)


_SETTLING = 0.5
"""Of a record, that the time behind all gaps may take, which nothing uses."""


def outside_gaps(record: Record, t: FloatArray, settling: float) -> BoolArray:
    """Return which times lie in no gap and not within `settling` (s) behind one, shape (n,).

    Less than `settling` where there are so many that most of the record would be left out.
    """
    outside, gaps = np.ones(len(t), bool), lost_commands(record)
    recorded = record.stop - record.start - sum(end - begin for begin, end in gaps) if gaps else 0.0
    for begin, end in gaps:
        outside &= (t <= begin) | (t >= end + min(settling, _SETTLING * recorded / len(gaps)))
    return outside


ON_GRID = 1e-3
"""Stamps this near to the end of a step, in steps, are meant to be there: half a microsecond."""


def in_steps(t: FloatArray, start: float, step: float) -> FloatArray:
    """Return stamps (s) in steps since `start`; those on the grid but for their rounding are put on it."""
    at = (t - start) / step
    nearest = np.rint(at)
    return np.asarray(np.where(np.abs(at - nearest) < ON_GRID, nearest, at))


@njit(cache=True, nogil=True)
def mean_of_held(at, y, count):  # type: ignore[no-untyped-def]
    """Return the mean over each step of the piecewise constant signal y held from its stamps (in steps)."""
    means, k = np.empty(count), 0
    for i in range(count):
        while k + 1 < len(at) and at[k + 1] <= i:
            k += 1
        total, since, j = 0.0, float(i), k
        while j + 1 < len(at) and at[j + 1] < i + 1:
            total += y[j] * (at[j + 1] - since)
            since, j = at[j + 1], j + 1
        means[i] = y[k] if j == k else total + y[j] * (i + 1 - since)
    return means


def mean_of_line(knots: FloatArray, y: FloatArray, count: int) -> FloatArray:
    """Return the mean over each step of the lines between the stamps (in steps), held beyond the last."""
    at = np.union1d(knots, np.arange(count + 1.0))
    line = np.interp(at, knots, y)
    return np.diff(np.interp(np.arange(count + 1.0), at, running_integral(line, at)))


def mean_of_curve(finer: int, knots: FloatArray, y: FloatArray, count: int) -> FloatArray:
    """Return the mean over each step of the band-limited curve through samples `finer` steps apart.

    By Simpson's rule, from the Fourier series of the samples and their mirror image: no jump at the ends.
    """
    from scipy.signal import resample

    series = resample(np.concatenate([y, y[::-1]]), 4 * finer * len(y))[: 2 * finer * (len(y) - 1) + 1]
    means = (series[:-2:2] + 4.0 * series[1:-1:2] + series[2::2]) / 6.0
    return np.concatenate([means, np.full(count, y[-1])])[:count]


LONGEST_STEP = 4.5e-4
"""s. The step is a whole fraction of the command's period and not longer than this."""

MOST_STEPS = 5e7
"""Of a record, six hours: a longer one needs more memory than most computers have."""

LONGEST_OF_JOINTS = 1e-3
"""s, where targets at tens of Hz command a position loop, whose firmware samples about as often."""


@dataclass(frozen=True)
class Drive:
    """The command on the step grid and the instants at which channels are wanted.

    step: s. start: record time of the first step, s. command: mean over each step of the held command,
    N m, or of the held target of a position loop, rad, shape (steps,). reference: rad, shape (steps,) or
    empty. angle: measured position at the end of each step, rad, or empty. at: for each channel the
    sampling instants in steps since `start`.
    initial: position (rad) and velocity (rad/s) at the start; spring: what its sensor shows there, where that
    counts. hold: steps in a command period.
    origin, whole: when the drive begins in its record and how long that is, s; they differ from 0 and
    `duration` when the drive is a piece of one. jumps: the command is held, not a line between its stamps.
    restarts: where it begins anew, behind gaps of the whole record and with each span.
    spans: first step and end of the parts that are simulated, in time; empty for all of it. No channel is
    wanted elsewhere.
    """

    step: float
    start: float
    command: FloatArray
    at: Mapping[str, FloatArray]
    reference: FloatArray
    angle: FloatArray
    initial: tuple[float, float]
    hold: int = 1
    origin: float = 0.0
    whole: float = math.nan
    jumps: bool = True
    restarts: tuple[Restart, ...] = ()
    spans: tuple[tuple[int, int], ...] = ()
    spring: SpringStart | None = None

    @property
    def simulated(self) -> tuple[tuple[int, int], ...]:
        """First step and end of each part that is simulated."""
        return self.spans or ((0, len(self.command)),)

    @cached_property
    def mixes(self) -> bool:
        """Whether a command changes within a step."""
        change = np.diff(self.command)
        return self.jumps and bool((change[:-1] * change[1:] > 0.0).any())

    @property
    def drift_time(self) -> float:
        """Time over which drifts reach their full size, s."""
        return self.duration if math.isnan(self.whole) else self.whole

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.step * len(self.command)

    def command_at(self, t: FloatArray) -> FloatArray:
        """Return the command that acts at instants t, s, in its unit."""
        steps = ((t - self.start) / self.step).astype(np.int64)
        return self.command[np.clip(steps, 0, len(self.command) - 1)]


def steps_per_sample(period: float, longest: float = LONGEST_STEP) -> int:
    """Return how many steps a command period is divided into."""
    return max(1, math.ceil(period / longest - 1e-9))


def drive_from(
    record: Record, *, refine: int = 1, closed_loop: bool = False, from_rest: bool = False,
    targeted: bool = False, hold: Hold = "zero",
) -> Drive:  # fmt: skip
    """Lay a record's command on the step grid. Raises IdentificationError for a record too short.

    refine divides the step further. closed_loop: a controller makes the command from the reference; what
    the bag's command has beside the measured motor torque, where there is one, is an outside disturbance.
    from_rest: the bench began at zero, not at the first samples. targeted: the commands are targets
    of a position loop, rad: it began at the first sample. hold: the command between two stamps,
    that of the first (zero), a straight line (first), or for an analogue command that was filtered and
    sampled the curve without a frequency above half the rate (band).
    """
    command = record["command"]
    if len(command) < 10:
        raise IdentificationError(
            f"{record.source}: command has {len(command)} samples, expected at least 10"
        )
    period = _period(command.t)
    steps = steps_per_sample(period, LONGEST_OF_JOINTS if targeted else LONGEST_STEP) * refine
    step = period / steps
    start = float(command.t[0])
    stop = max(record.stop, float(command.t[-1]) + period)
    check_extent(record, start, stop)
    check_slow(record)
    count = math.ceil((stop - start) / step - 1e-6)
    if count > MOST_STEPS:
        raise IdentificationError(
            f"{record.source}: lasts {stop - start:.4g} s, expected up to {MOST_STEPS * step:.4g} s: "
            f"{AS_SECONDS} If so, cut the record"
        )
    knots, torque = in_steps(command.t, start, step), command.y
    if closed_loop:
        shown, asked = record["motor_torque" if "motor_torque" in record else "command"], record["reference"]
        torque = torque - np.interp(command.t, shown.t, shown.y)
    jumps = hold == "zero"
    means = {"zero": mean_of_held, "first": mean_of_line, "band": partial(mean_of_curve, steps)}
    held = means[hold](knots, torque, count)
    at = {n: in_steps(record[n].t, start, step) for n in OUTPUTS if n in record}
    ends = np.asarray(start + step * np.arange(1, count + 1), np.float64)
    return Drive(
        step=step, start=start, command=held, at=MappingProxyType(at),
        reference=np.interp(ends - step, asked.t, asked.y) if closed_loop else np.empty(0),
        angle=angle_at(record, ends),
        initial=(0.0, 0.0) if from_rest else first_state(record) if targeted else initial_state(record),
        hold=steps, jumps=jumps, restarts=restarts(record, start, step, from_rest=from_rest),
    )


def coarser(drive: Drive) -> Drive:
    """Return a drive on steps twice as long, for a first look: at half the cost four times the error.

    One whose command changes within a doubled step is returned unchanged: the motor torque that is read there
    would be off by the change.
    """
    steps = len(drive.command) // 2 * 2
    pairs = drive.command[:steps].reshape(-1, 2)
    if drive.hold % 2 or not np.array_equal(pairs[:, 0], pairs[:, 1]):
        return drive
    return replace(
        drive, step=2.0 * drive.step, command=pairs.mean(axis=1),
        at={n: at / 2.0 for n, at in drive.at.items()},
        reference=drive.reference[:steps:2], angle=drive.angle[1:steps:2], hold=drive.hold // 2,
        restarts=tuple((k // 2, state) for k, state in drive.restarts),
        spans=tuple((first // 2, end // 2) for first, end in drive.spans),
    )


def finer(drive: Drive) -> Drive:
    """Return a drive on steps half as long; a command that changes within a step keeps its instant."""
    mean = drive.command
    before, after = np.append(mean[0], mean[:-1]) - mean, np.append(mean[1:], mean[-1]) - mean
    beyond = 0.125 * (before - after)  # the mean, in the first half: of a line between stamps
    if drive.jumps:
        mixed = before * after < 0.0
        share = after / np.where(mixed, after - before, 1.0)
        early = np.clip(2.0 * share, 0.0, 1.0)
        beyond = np.where(mixed, early * before + (1.0 - early) * after, 0.0)
    ends, halves = np.arange(len(mean)), 0.5 * np.arange(2 * len(mean))
    return replace(
        drive, step=0.5 * drive.step, command=np.column_stack([mean + beyond, mean - beyond]).ravel(),
        at={n: 2.0 * at for n, at in drive.at.items()},
        reference=np.interp(halves, ends, drive.reference) if len(drive.reference) else drive.reference,
        angle=np.interp(halves - 0.5, ends, drive.angle) if len(drive.angle) else drive.angle,
        hold=2 * drive.hold, restarts=tuple((2 * k, state) for k, state in drive.restarts),
        spans=tuple((2 * first, 2 * end) for first, end in drive.spans),
    )  # fmt: skip


def _period(t: FloatArray) -> float:
    """Return the command period, s: the span over the number of periods, each interval counted by itself.

    Stamps may be coarse: a median interval that is 2e-5 off makes one period too few of 44 800.
    """
    intervals = np.diff(t)
    median = float(np.median(intervals))
    if not median > 0.0:
        raise IdentificationError(f"command: median stamp interval {median:g} s, expected > 0 s")
    return float(t[-1] - t[0]) / max(1.0, float(np.sum(np.round(intervals / median))))
