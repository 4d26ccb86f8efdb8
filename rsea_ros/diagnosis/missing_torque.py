"""The torque that a model lacks for the measured motion, and what of it repeats with the rotor's angle.

    J_m a + b_m v + T - T_m,   all but the command measured

A simulated rotor angle of a 502:1 gear loses its phase; the measured one does not.
"""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.diagnosis.peaks import peaks, refined, sine_at
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

_FEWEST_PERIODS = 1.5
"""As often a ripple must have repeated over the rotor's travel to be one."""
_FEWEST, _MOST = 0.5, 60.0
"""Cycles per revolution of a ripple."""
_REVOLUTIONS = 8
"""After so many every whole multiple of 1/8 cycle repeats."""
_BINS = 1 << 13


def ripples(case: Case, rig: Rig) -> list[dict[str, float]]:
    """Return cycles per revolution, amplitude (N m) and phase (rad) of what repeats most."""
    found = missing_torque(case, rig)
    if found is None:
        return []
    angle, torque = found[0] * rig["gear.ratio"], found[1] - np.mean(found[1])
    cycles, power = _periodogram(angle, torque)
    seen = (cycles >= _FEWEST) & (cycles * np.ptp(angle) > 2.0 * math.pi * _FEWEST_PERIODS)
    power = np.where(seen & (cycles < _MOST), power, 0.0)
    at = [refined(cycles, power, k) for k in peaks(power, apart=6)]
    return [{"cycles_per_revolution": c, **sine_at(angle, torque, c)} for c in at]


def _periodogram(angle: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cycles per revolution and their power: a sum over bins of the angle, folded where all repeat."""
    folded = (angle / (2.0 * math.pi * _REVOLUTIONS) % 1.0 * _BINS).astype(np.int64) % _BINS
    power = np.abs(np.fft.rfft(np.bincount(folded, torque, _BINS))) ** 2
    return np.arange(len(power)) / _REVOLUTIONS, power


def missing_torque(case: Case, rig: Rig) -> tuple[FloatArray, FloatArray] | None:
    """Return the measured position (rad) and the torque that is missing there, N m.

    None without a position, or for a free housing.
    """
    if (
        not isinstance(case.drive, Drive)
        or "position" not in case.measured
        or "housing_end" not in rig.clamped
    ):
        return None
    t, q = case.t["position"], case.measured["position"]
    v = (
        np.interp(t, case.t["velocity"], case.measured["velocity"])
        if "velocity" in case.measured
        else np.gradient(q, t)
    )
    load = (
        np.interp(t, case.t["ft"], case.measured["ft"])
        if "ft" in case.measured
        else rig["spring.stiffness"] * q
    )
    acceleration = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    inertia = rig["rotor.reflected_inertia"] + rig["chassis.inertia"]
    torque = inertia * acceleration + rig["rotor.reflected_damping"] * v[1:-1] + load[1:-1]
    torque -= _command_around(case.drive, t[1:-1] - case.start, float(np.median(np.diff(t))))
    keep = case.mask["position"][1:-1]
    return q[1:-1][keep], torque[keep]


def _command_around(drive: Drive, t: FloatArray, period: float) -> FloatArray:
    """Return the mean of the command from a sample's period before each time to one after, N m."""
    steps = np.clip((t / drive.step).astype(int), 0, len(drive.command) - 1)
    width = max(1, round(period / drive.step))
    mean = np.convolve(drive.command, np.ones(2 * width) / (2 * width), mode="same")
    return np.asarray(mean[steps])
