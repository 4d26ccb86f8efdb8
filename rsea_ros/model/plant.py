"""A simulated bench that is stepped one sample at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.model.drive import steps_per_sample
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import build, measure, run, sensor_noise
from rsea_ros.model.step import OUTPUTS


@dataclass(frozen=True)
class PlantSample:
    """One measurement of the plant: rad, rad/s, N m, N m (nan without a spring to measure), rad."""

    position: float
    velocity: float
    motor_torque: float
    ft: float
    deflection: float


class Plant:
    """A bench that is stepped one sample at a time, with the noise and the quantum of its sensors."""

    def __init__(self, rig: Rig, rate: float, *, seed: int = 0, noise: bool = True) -> None:
        """rate: samples a second. Drifts reach their full size in a minute."""
        self._rig, self._noise = rig, noise
        self._count = steps_per_sample(1.0 / rate)
        self._step = 1.0 / rate / self._count
        self._out = np.empty((self._count, len(OUTPUTS)))
        self._rng = sensor_noise(seed)
        self.reset()

    def reset(self) -> None:
        """Go back to rest, at time zero."""
        self._machine = build(self._rig, self._step, 60.0)
        self._time = 0.0

    def step(self, command: float) -> PlantSample:
        """Hold a command (N m) for one sample period and return the measurement at its end."""
        run(self._machine, np.full(self._count, command), self._out, start=self._time)
        self._time += self._count * self._step
        values = dict(zip(OUTPUTS, self._out[-1], strict=True))
        if self._noise:
            values = {n: float(measure(self._rig, n, v, self._rng)) for n, v in values.items()}
        ft = math.nan if self._rig.rigid_spring else float(values["ft"])
        position, velocity, torque = (float(values[n]) for n in ("position", "velocity", "motor_torque"))
        return PlantSample(position, velocity, torque, ft, float(values["deflection"]))
