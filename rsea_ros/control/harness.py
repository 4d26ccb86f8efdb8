"""The loop faster than real time: the simulated bench and the controller, one sample at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.grid import Grid, Lateness
from rsea_ros.model.plant import Plant, PlantSample
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

PARTS = 10
"""Of a period, between which the simulation distinguishes instants."""
LONG_AGO = 10**12
"""ns, stamp of the first measurement."""


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
    controller.start(_reading(sample), float(desired[0]))
    for k, wanted in enumerate(np.append(desired[ahead:], np.full(ahead, desired[-1]))):
        command = controller.step(_reading(sample), float(wanted))
        rows[k] = sample.ft, command, sample.velocity
        sample = plant.step(pending.pop(0))
        pending.append(command)
    return ControlTrace(
        np.arange(len(desired)) / rate, np.asarray(desired), rows[:, 0], rows[:, 1], rows[:, 2]
    )


@dataclass(frozen=True)
class Arrivals:
    """When measurements are taken and commands act, of n samples, in periods.

    taken: by how much each measurement is taken after its place; nan for one that is lost. acting: by how
    much the resulting command acts after its sample. ft_age: by how much its
    torque is older than the rest of it. Each of shape (n,); ft_age may be one number.
    """

    taken: FloatArray
    acting: FloatArray
    ft_age: FloatArray | float = 0.0


def irregular(
    rig: Rig,
    rate: float,
    controller: TorqueController,
    desired: FloatArray,
    arrivals: Arrivals,
) -> ControlTrace:
    """Run a controller on a simulated rig with measurements and commands that come when they come.

    As the node does it: a grid gives each stamp its place, lateness fades the feedback. Held to a part
    PARTS of a period.
    """
    plant, grid, lateness = Plant(rig, rate * PARTS), Grid(1e9 / rate), Lateness(rate)
    due = {round((k + off) * PARTS): k for k, off in enumerate(arrivals.taken) if np.isfinite(off)}
    acting: dict[int, float] = {}
    ages = np.broadcast_to(arrivals.ft_age, len(desired))
    rows, torque, command, numbers = [], 0.0, 0.0, np.arange(len(desired))
    sample = plant.step(0.0)
    torques = [sample.ft]
    controller.start(_reading(sample), float(desired[0]))
    for part in range(len(desired) * PARTS):
        if part in due:
            periods = grid.place(round(part / PARTS / rate * 1e9 + LONG_AGO))
            late = float(arrivals.acting[due[part]])
            trust = lateness.take(max(late, periods - 1), max(1, periods))
            if periods:
                wanted = float(np.interp((grid.at - LONG_AGO) * 1e-9 * rate, numbers, desired))
                back = min(round(ages[due[part]] * PARTS), part)
                reading = replace(_reading(sample), ft=torques[part - back], ft_age=back / PARTS)
                command = controller.step(reading, wanted, periods - 1, trust=trust, offset=grid.offset)
                acting[part + round((1.0 + late) * PARTS)] = command
        if part % PARTS == 0:
            rows.append((sample.ft, command, sample.velocity))
        torque = acting.pop(part, torque)
        sample = plant.step(torque)
        torques.append(sample.ft)
    n = np.array(rows)
    return ControlTrace(np.arange(len(n)) / rate, np.asarray(desired), n[:, 0], n[:, 1], n[:, 2])


def _reading(sample: PlantSample) -> Measurement:
    link = sample.position - sample.deflection
    return Measurement(sample.ft, sample.velocity, sample.position, sample.motor_torque, link=link)
