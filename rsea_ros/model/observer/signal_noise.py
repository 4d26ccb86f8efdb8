"""Noise of the observed signals, and the consistency of innovations with it.

The disturbance is a random walk. Its intensity comes from a torque of RMS sigma that keeps for a time tau:
over times short against tau such an Ornstein-Uhlenbeck process is a random walk of intensity

    2 sigma^2 / tau    (N m)^2/s

tau = 1 / |slowest pole| of the actuator between clamped ends: the filter follows anything slower.
sigma is the residual of the F/T signal beyond its noise, and never less than the doubt in the measured
motor torque: a torque too small for that sensor cannot be excluded.
Source: Gardiner, Handbook of Stochastic Methods, 2004, section 3.8.4.

Where the model is right nu^2 / S, the squared innovation over its variance, is chi-square distributed with
one degree of freedom and white: the sum over a window of n samples has n degrees of freedom.
Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri  # chi2.isf, without the 0.3 s of scipy.stats

from rsea_ros.documents.units import plain
from rsea_ros.errors import RigError
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.records.record import UNITS, FloatArray

NOTHING: Mapping[str, float] = {}


@dataclass(frozen=True)
class Noise:
    """One sigma of position (rad), ft (N m) and motor torque (N m; 0: not measured); of the disturbance
    (N m), and its correlation time, s. A channel that the rig's sensors lack is infinite: it adds no
    information.
    """

    position: float
    ft: float
    motor_torque: float
    disturbance: float
    tau: float

    @property
    def walk(self) -> float:
        """Intensity of the disturbance's random walk, (N m)^2/s."""
        return 2.0 * self.disturbance**2 / self.tau


def noise_of(rig: Rig, noise_rms: Mapping[str, float] = NOTHING,
             residual_rms: Mapping[str, float] = NOTHING) -> Noise:  # fmt: skip
    """Return the noise of a rig's sensors, or that measured by an identification, by channel.

    Raises RigError where neither has a sensor of the rig.
    """
    position, ft, torque = (_sigma(rig, n, noise_rms) for n in ("position", "ft", "motor_torque"))
    if math.isinf(position) and math.isinf(ft):
        raise RigError(f"rig {rig.name}: sensors {', '.join(rig.sensors)}, expected position or ft")
    known = [s for s in (torque, ft) if math.isfinite(s)]
    unexplained = residual_rms.get("ft", 0.0) ** 2 - (ft**2 if math.isfinite(ft) else 0.0)
    sigma = max(known[0] if known else 0.0, math.sqrt(max(0.0, unexplained)))
    if sigma == 0.0:
        raise RigError(f"rig {rig.name}: sensors has no torque, expected motor_torque or ft with noise, N·m")
    held = rig if rig.rigid_spring else replace(rig, clamped=frozenset(END_NAMES))
    rates = np.abs(np.linalg.eigvals(state_space(held).a))
    slowest = float(rates[rates > 1e-6 * rates.max()].min())
    return Noise(position, ft, torque if math.isfinite(torque) else 0.0, sigma, 1.0 / slowest)


def _sigma(rig: Rig, channel: str, noise_rms: Mapping[str, float]) -> float:
    if channel not in rig.sensors:
        return math.inf
    sensor = rig.sensors[channel]
    sigma = noise_rms.get(channel, sensor.level)
    if not sigma > 0.0:
        raise RigError(
            f"rig {rig.name}: sensors.{channel}.noise = {sigma:g} {plain(UNITS[channel])}, "
            "expected > 0, as measured"
        )
    return sigma


CHANNELS = ("position", "ft", "motor_torque")
FALSE_ALARM = 1e-6
"""Probability that a right model is called inconsistent in a window: once in ten days of windows of 1 s."""


class Consistency(NamedTuple):
    """ratio: RMS of the innovations over its expected value.

    limit: the largest allowed. mean: in the channel's unit.
    """

    ratio: float
    limit: float
    mean: float

    @property
    def broken(self) -> bool:
        """Whether the model is inconsistent with this channel."""
        return self.ratio > self.limit


def consistency(score: FloatArray) -> dict[str, Consistency]:
    """Return the test of each channel that had samples. score: sums of nu^2 / S, 1, nu, shape (3, 3).

    A late sample changes innovations that were already counted, so a sum may decrease: to zero at least.
    """
    return {
        name: Consistency(math.sqrt(max(total, 0.0) / count), _limit(round(count)), sum_ / count)
        for name, (total, count, sum_) in zip(CHANNELS, score.tolist(), strict=True)
        if count >= 1.0 and math.isfinite(total + sum_)
    }


@lru_cache(maxsize=64)
def _limit(count: int) -> float:
    return math.sqrt(float(chdtri(count, FALSE_ALARM)) / count)
