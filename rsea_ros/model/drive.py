"""What drives a simulation: the command held at its stamps, on the grid of the fixed step, and where each
channel is sampled. Made once for a record, used by every simulation of a fit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numba import njit

from rsea_ros.errors import IdentificationError
from rsea_ros.model.step import OUTPUTS
from rsea_ros.signals import Channel, FloatArray, Record

LONGEST_STEP = 4.5e-4
"""s. The step is a whole fraction of the command's period and not longer than this."""


@dataclass(frozen=True)
class Drive:
    """The command on the step grid and the instants at which channels are wanted.

    step: s. start: record time of the first step, s. command: mean over each step of the held command,
    N m, shape (steps,). reference: rad, shape (steps,) or empty. angle: measured position at the end of
    each step, rad, or empty. at: for each channel the sampling instants in steps since `start`.
    initial: position (rad) and velocity (rad/s) at the start.
    """

    step: float
    start: float
    command: FloatArray
    at: Mapping[str, FloatArray]
    reference: FloatArray
    angle: FloatArray
    initial: tuple[float, float]

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.step * len(self.command)


def steps_per_sample(period: float, longest: float = LONGEST_STEP) -> int:
    """Return how many steps a command period is divided into."""
    return max(1, math.ceil(period / longest - 1e-9))


def drive_from(record: Record, *, refine: int = 1, closed_loop: bool = False) -> Drive:
    """Lay a record's command on the step grid. Raises IdentificationError for a record too short.

    refine divides the step further. closed_loop: a controller makes the command from the reference; what
    the bag's command has beside the measured motor torque is then an outside disturbance.
    """
    command = record["command"]
    if len(command) < 10:
        raise IdentificationError(
            f"{record.source}: command has {len(command)} samples, expected at least 10"
        )
    period = _period(command.t)
    step = period / (steps_per_sample(period) * refine)
    start = float(command.t[0])
    stop = max(record.stop, float(command.t[-1]) + period)
    count = math.ceil((stop - start) / step - 1e-6)
    held = _mean_of_held(command.t - start, command.y, step, count)
    if closed_loop:
        held = held - _mean_of_held(
            command.t - start, np.interp(command.t, *_ty(record["motor_torque"])), step, count
        )
    ends = start + step * np.arange(1, count + 1)
    return Drive(
        step=step,
        start=start,
        command=held,
        at=MappingProxyType({n: (record[n].t - start) / step for n in OUTPUTS if n in record}),
        reference=np.interp(ends - step, *_ty(record["reference"])) if closed_loop else np.empty(0),
        angle=np.interp(ends, *_ty(record["position"])) if "position" in record else np.empty(0),
        initial=_initial(record),
    )


def _period(t: FloatArray) -> float:
    """Return the command period: the span over the number of median intervals in it, s."""
    median = float(np.median(np.diff(t)))
    if not median > 0.0:
        raise IdentificationError(f"command: median stamp interval {median:g} s, expected > 0 s")
    span = float(t[-1] - t[0])
    return span / max(1, round(span / median))


def _ty(channel: Channel) -> tuple[FloatArray, FloatArray]:
    return channel.t, channel.y


def _initial(record: Record) -> tuple[float, float]:
    position = float(record["position"].y[0]) if "position" in record else 0.0
    velocity = float(record["velocity"].y[0]) if "velocity" in record else 0.0
    return position, velocity


@njit(cache=True, nogil=True)
def _mean_of_held(t, y, step, count):  # type: ignore[no-untyped-def]
    """Return the mean over each step of the piecewise constant signal y held from its stamps t (s)."""
    means, k = np.empty(count), 0
    for i in range(count):
        begin, end = i * step, (i + 1) * step
        while k + 1 < len(t) and t[k + 1] <= begin:
            k += 1
        total, at, j = 0.0, begin, k
        while j + 1 < len(t) and t[j + 1] < end:
            total += y[j] * (t[j + 1] - at)
            at, j = t[j + 1], j + 1
        means[i] = y[k] if j == k else (total + y[j] * (end - at)) / step
    return means


@njit(cache=True, nogil=True)
def _sample_smooth(values, at):  # type: ignore[no-untyped-def]
    """Interpolate values at steps 0, 1, 2, … at fractional steps, by cubics through four points."""
    out, last = np.empty(len(at)), len(values) - 1
    for i in range(len(at)):
        u = min(max(at[i], 0.0), float(last))
        k = min(max(int(u), 1), last - 2)
        w = u - k
        a, b, c, d = values[k - 1], values[k], values[k + 1], values[k + 2]
        out[i] = b + 0.5 * w * (c - a + w * (2 * a - 5 * b + 4 * c - d + w * (3 * (b - c) + d - a)))
    return out


@njit(cache=True, nogil=True)
def _sample_held(values, at):  # type: ignore[no-untyped-def]
    """Return the value of the step that ends nearest to each instant (a hold that just ended)."""
    out = np.empty(len(at))
    for i in range(len(at)):
        out[i] = values[min(max(int(np.rint(at[i])), 1), len(values) - 1)]
    return out


def sample(name: str, values: FloatArray, at: FloatArray) -> FloatArray:
    """Return a simulated channel at its sampling instants; `values` begins with the initial one."""
    sampler = _sample_held if name == "motor_torque" else _sample_smooth
    result: FloatArray = sampler(values, at)
    return result
