"""What drives a simulation: commands held between their stamps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from types import MappingProxyType

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.errors import IdentificationError
from rsea_ros.model.extent import AS_SECONDS, check_extent, check_slow
from rsea_ros.model.restarts import Restart, angle_at, first_state, initial_state, restarts
from rsea_ros.model.rig import Hold
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import Channel, FloatArray, Record

ON_GRID = 1e-3
"""Stamps this near to the end of a step, in steps, are meant to be there: half a microsecond."""


def in_steps(t: FloatArray, start: float, step: float) -> FloatArray:
    """Return stamps (s) in steps since `start`; those on the grid but for their rounding are put on it."""
    at = (t - start) / step
    nearest = np.rint(at)
    result: FloatArray = np.where(np.abs(at - nearest) < ON_GRID, nearest, at)
    return result


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
    area = np.concatenate([[0.0], np.cumsum(0.5 * (line[1:] + line[:-1]) * np.diff(at))])
    return np.diff(np.interp(np.arange(count + 1.0), at, area))


def mean_of_curve(finer: int, knots: FloatArray, y: FloatArray, count: int) -> FloatArray:
    """Return the mean over each step of the band-limited curve through samples `finer` steps apart.

    By Simpson's rule, from the Fourier series of the samples and their mirror image: no jump at the ends.
    """
    from scipy.signal import resample

    series = resample(np.concatenate([y, y[::-1]]), 4 * finer * len(y))[: 2 * finer * (len(y) - 1) + 1]
    means = (series[:-2:2] + 4.0 * series[1:-1:2] + series[2::2]) / 6.0
    return np.concatenate([means, np.full(count, y[-1])])[:count]


def beside_mean(knots: FloatArray, y: FloatArray, means: FloatArray, at: FloatArray) -> FloatArray:
    """Return the integral of the held signal minus the integral of its means, at instants; all in steps."""
    off_grid = at != np.rint(at)
    if not off_grid.any() or (knots == np.rint(knots)).all():
        return np.zeros(len(at))
    last = float(len(means))
    end = max(last, float(knots[-1]))
    held = np.concatenate([[0.0], np.cumsum(y * np.diff(knots, append=end))])
    stepped = np.concatenate([[0.0], np.cumsum(means)])
    inside = np.clip(at, 0.0, last)
    beside = np.interp(inside, np.append(knots, end), held) - np.interp(inside, np.arange(last + 1), stepped)
    return np.where(off_grid, beside, 0.0)


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
    impulse: of the held command up to each instant beyond its mean over the step, N m s.
    initial: position (rad) and velocity (rad/s) at the start. hold: steps in a command period.
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
    impulse: Mapping[str, FloatArray]
    reference: FloatArray
    angle: FloatArray
    initial: tuple[float, float]
    hold: int = 1
    origin: float = 0.0
    whole: float = math.nan
    jumps: bool = True
    restarts: tuple[Restart, ...] = ()
    spans: tuple[tuple[int, int], ...] = ()

    @property
    def simulated(self) -> tuple[tuple[int, int], ...]:
        """First step and end of each part that is simulated."""
        return self.spans or ((0, len(self.command)),)

    @cached_property
    def kinks(self) -> FloatArray:
        """Command by step where velocities have a kink: nowhere for one that does not jump."""
        return self.command if self.jumps else np.zeros(len(self.command))

    @cached_property
    def impulsive(self) -> frozenset[str]:
        """The channels that are read where the held command has brought more or less than its mean."""
        return frozenset(n for n, impulse in self.impulse.items() if impulse.any())

    @property
    def drift_time(self) -> float:
        """Time over which drifts reach their full size, s."""
        return self.duration if math.isnan(self.whole) else self.whole

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.step * len(self.command)


def steps_per_sample(period: float, longest: float = LONGEST_STEP) -> int:
    """Return how many steps a command period is divided into."""
    return max(1, math.ceil(period / longest - 1e-9))


def drive_from(
    record: Record,
    *,
    refine: int = 1,
    closed_loop: bool = False,
    from_rest: bool = False,
    targeted: bool = False,
    hold: Hold = "zero",
) -> Drive:
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
        shown = "motor_torque" if "motor_torque" in record else "command"
        torque = torque - np.interp(command.t, *_ty(record[shown]))
    jumps = hold == "zero"
    means = {"zero": mean_of_held, "first": mean_of_line, "band": partial(mean_of_curve, steps)}
    held = means[hold](knots, torque, count)
    at = {n: in_steps(record[n].t, start, step) for n in OUTPUTS if n in record}
    beside = {n: beside_mean(knots, torque, held, a) if jumps else np.zeros(len(a)) for n, a in at.items()}
    ends = np.asarray(start + step * np.arange(1, count + 1), np.float64)
    return Drive(
        step=step,
        start=start,
        command=held,
        at=MappingProxyType(at),
        impulse=MappingProxyType({n: step * b for n, b in beside.items()}),
        reference=np.interp(ends - step, *_ty(record["reference"])) if closed_loop else np.empty(0),
        angle=angle_at(record, ends),
        initial=(0.0, 0.0) if from_rest else first_state(record) if targeted else initial_state(record),
        hold=steps,
        jumps=jumps,
        restarts=restarts(record, start, step, from_rest=from_rest),
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
    brought = np.concatenate([[0.0], np.cumsum(drive.command[:steps])])

    def beside(at: FloatArray) -> FloatArray:
        inside, ends = np.clip(at, 0.0, float(steps)), np.arange(steps + 1)
        pairwise = np.interp(inside, ends[::2], brought[::2])
        return np.asarray(drive.step * (np.interp(inside, ends, brought) - pairwise))

    return replace(
        drive,
        step=2.0 * drive.step,
        command=pairs.mean(axis=1),
        at={n: at / 2.0 for n, at in drive.at.items()},
        impulse={n: i + beside(drive.at[n]) for n, i in drive.impulse.items()},
        reference=drive.reference[:steps:2],
        angle=drive.angle[1:steps:2],
        hold=drive.hold // 2,
        restarts=tuple((k // 2, state) for k, state in drive.restarts),
        spans=tuple((first // 2, end // 2) for first, end in drive.spans),
    )


def _period(t: FloatArray) -> float:
    """Return the command period, s: the span over the number of periods, each interval counted by itself.

    Stamps may be coarse: a median interval that is 2e-5 off makes one period too few of 44 800.
    """
    intervals = np.diff(t)
    median = float(np.median(intervals))
    if not median > 0.0:
        raise IdentificationError(f"command: median stamp interval {median:g} s, expected > 0 s")
    return float(t[-1] - t[0]) / max(1.0, float(np.sum(np.round(intervals / median))))


def _ty(channel: Channel) -> tuple[FloatArray, FloatArray]:
    return channel.t, channel.y
