"""The loop faster than real time: the simulated bench and the controller, one sample at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.model.plant import Plant, PlantSample
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class ControlTrace:
    """One run: t (s), desired, ft and command (N m), velocity (rad/s), all at the samples, shape (n,)."""

    t: FloatArray
    desired: FloatArray
    ft: FloatArray
    command: FloatArray
    velocity: FloatArray

    def error(self, settle: float = 0.0) -> float:
        """Return the RMS of ft - desired from `settle` (s) on, over that of desired."""
        late = self.t >= settle
        wanted = self.desired[late]
        return float(np.sqrt(np.mean((self.ft[late] - wanted) ** 2) / np.mean(wanted**2)))


def closed_loop(
    rig: Rig,
    rate: float,
    controller: TorqueController,
    desired: FloatArray,
    *,
    noise: bool = True,
    seed: int = 0,
    ahead: int = 0,
    late: int = 0,
) -> ControlTrace:
    """Run a controller on a simulated rig from rest. desired: N m at the samples, shape (n,).

    A command that is computed at a sample acts from the next one on: one sample of delay. late: samples
    more. ahead: samples by which the controller knows the desired torque before it is due.
    """
    plant = Plant(rig, rate, seed=seed, noise=noise)
    sample = plant.step(0.0)
    pending, rows = [0.0] * (1 + late), np.empty((len(desired), 3))
    controller.start(reading(sample), float(desired[0]))
    for k, wanted in enumerate(np.append(desired[ahead:], np.full(ahead, desired[-1]))):
        command = controller.step(reading(sample), float(wanted))
        rows[k] = sample.ft, command, sample.velocity
        sample = plant.step(pending.pop(0))
        pending.append(command)
    return ControlTrace(
        np.arange(len(desired)) / rate, np.asarray(desired), rows[:, 0], rows[:, 1], rows[:, 2]
    )


def reading(sample: PlantSample) -> Measurement:
    """Return what a controller reads of a sample."""
    link = sample.position - sample.deflection
    return Measurement(sample.ft, sample.velocity, sample.position, sample.motor_torque, link=link)
