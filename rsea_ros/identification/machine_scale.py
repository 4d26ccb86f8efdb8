"""The size of a machine as its rig and its records show it, for the bounds and starts of effects."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rsea_ros.effects.scale import STIFFNESS, TORQUE, Scale, scale_to
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.model.position_loop import loop_parameters
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

LARGEST = 0.999
"""Quantile that is taken for the largest value: a few samples may be outliers."""
_LAG = 0.02
"""s over which the measured angle is differenced for a speed: over one sample it were the encoder's step."""


def scale_of(cases: Sequence[Case], rig: Rig) -> Scale:
    """Return how a machine and its records compare with the machine of the catalogue."""
    torque = max((torque_size(case, rig) for case in cases), default=0.0)
    stiffness = STIFFNESS * torque / TORQUE if rig.rigid_spring else rig["spring.stiffness"]
    speed = max((_speed(case) for case in cases), default=0.0)
    inertia = rig["rotor.reflected_inertia"]
    return scale_to(torque, stiffness, inertia, speed, max((_period(case) for case in cases), default=0.0))


def torque_size(case: Case, rig: Rig) -> float:
    """Return the largest torque of a run, N m: commanded, or measured in the motor or by the F/T sensor.

    Of a position loop: measured in the motor, otherwise computed from its errors. 0 where unknown.
    """
    if rig.loop is None:
        shown = [_largest(case, n) for n in ("motor_torque", "ft") if n in case.measured]
        commanded = [_quantile(case.drive.command)] if isinstance(case.drive, Drive) else []
        return max([*commanded, *shown], default=0.0)
    if "motor_torque" in case.measured:
        return _largest(case, "motor_torque")
    return _torque_of_errors(case, rig)


def _torque_of_errors(case: Case, rig: Rig) -> float:
    """Return the largest torque of a position loop by its errors, N m; 0 without a position."""
    if "position" not in case.measured or not isinstance(case.drive, Drive):
        return 0.0
    keep, drive = case.mask["position"], case.drive
    steps = ((case.t["position"][keep] - drive.start) / drive.step).astype(np.int64)
    error = drive.command[np.clip(steps, 0, len(drive.command) - 1)] - case.measured["position"][keep]
    _, position, _, velocity, *_ = loop_parameters(rig)
    gain = position if rig.loop == "pd" else position * velocity
    return gain * _quantile(error)


def _speed(case: Case) -> float:
    """Return the largest speed of a run, rad/s; 0 where neither speed nor angle was measured."""
    if not isinstance(case.drive, Drive):
        return _quantile(case.drive.v)
    if "velocity" in case.measured:
        return _largest(case, "velocity")
    if "position" not in case.measured:
        return 0.0
    t, q = (values["position"][case.mask["position"]] for values in (case.t, case.measured))
    lag = max(1, round(_LAG / _period(case)))
    return _quantile((q[lag:] - q[:-lag]) / (t[lag:] - t[:-lag])) if len(q) > lag else 0.0


def _period(case: Case) -> float:
    """Return the time between samples of the channel that has most of them, s."""
    periods = [float(np.median(np.diff(t))) for t in case.t.values() if len(t) > 1]
    return min(periods, default=math.nan)


def _largest(case: Case, channel: str) -> float:
    return _quantile(case.measured[channel][case.mask[channel]])


def _quantile(values: FloatArray) -> float:
    return float(np.quantile(np.abs(values), LARGEST)) if len(values) else 0.0
