"""Commands that act late: feedback fades with lateness, and lateness that persists is a fault."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.following import ControlTrace, reading
from rsea_ros.control.grid import Grid, Lateness, Tolerance
from rsea_ros.control.law import Gains
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.nodes import _control as _controller_limits

RATES = {
    280.0: Gains(0.2575, 0.003029, 1.195, 6.99, 42.9),
    1000.0: Gains(0.2446, 0.00087, 0.612, 29.97, 53.6),
}
RIG = load_rig("paper_high_impedance")
VALUES = {
    "error_limit": 15.0, "error_time": 0.5, "ft_limit": 110.0, "late_share": 0.5, "late_time": 1.0,
    "rate": 280.0, "rig": "paper_high_impedance",
}  # fmt: skip


def largest(rate, seed):
    """Return the largest |ft| and the share of commands at the limit, 10 N m at 5 Hz, bursts 2 to 8 late."""
    dice, lateness = np.random.default_rng(seed), Lateness(rate)
    plant = Plant(RIG, rate, seed=seed)
    controller = TorqueController(RIG, rate, RATES[rate])
    sample, acting, queue, rows, left, late = plant.step(0.0), 0.0, [], [], 0, 0
    for k in range(round(3.0 * rate)):
        if left <= 0:
            left, late = dice.geometric(0.2), dice.choice((0, dice.integers(2, 9)))
        left -= 1
        reading = Measurement(sample.ft, sample.velocity, sample.position, sample.motor_torque)
        wanted = 10.0 * math.sin(2.0 * math.pi * 5.0 * k / rate)
        torque = controller.step(reading, wanted, trust=lateness.take(late))
        queue.append((max(k + 1 + late, queue[-1][0] if queue else 0), torque))
        rows.append((abs(sample.ft), abs(torque) > 67.9))
        while queue and queue[0][0] <= k:
            acting = queue.pop(0)[1]
        sample = plant.step(acting)
    ft, limited = np.array(rows)[round(rate) :].T
    return ft.max(), limited.mean()


@pytest.mark.parametrize("rate", RATES)
def test_feedback_that_fades_with_lateness_stays_stable(rate):
    for seed in (1, 2) if rate < 500.0 else (1,):
        ft, limited = largest(rate, seed)
        assert ft < 13.0 and limited == 0.0


PARTS = 10
"""Of a period, between which the simulation distinguishes instants."""
LONG_AGO = 10**12
"""ns, stamp of the first measurement."""


def irregular(rate, desired, taken, acting, ft_age=0.0):
    """Run a controller on a simulated rig with measurements and commands that come when they come.

    As the node does it: a grid gives each stamp its place, lateness fades the feedback. Held to a part
    PARTS of a period. In periods, for each sample: taken: by how much each measurement is taken after its
    place; nan for one that is lost. acting: by how much the resulting command acts after its sample. ft_age:
    by how much its torque is older than the rest of it.
    """
    controller = TorqueController(RIG, rate, RATES[rate])
    plant, grid, lateness = Plant(RIG, rate * PARTS), Grid(1e9 / rate), Lateness(rate)
    due = {round((k + off) * PARTS): k for k, off in enumerate(taken) if np.isfinite(off)}
    commands, ages = {}, np.broadcast_to(ft_age, len(desired))
    rows, torque, command, numbers = [], 0.0, 0.0, np.arange(len(desired))
    sample = plant.step(0.0)
    torques = [sample.ft]
    controller.start(reading(sample), float(desired[0]))
    for part in range(len(desired) * PARTS):
        if part in due:
            periods = grid.place(round(part / PARTS / rate * 1e9 + LONG_AGO))
            late = float(acting[due[part]])
            trust = lateness.take(max(late, periods - 1), max(1, periods))
            if periods:
                wanted = float(np.interp((grid.at - LONG_AGO) * 1e-9 * rate, numbers, desired))
                back = min(round(ages[due[part]] * PARTS), part)
                read = replace(reading(sample), ft=torques[part - back], ft_age=back / PARTS)
                command = controller.step(read, wanted, periods - 1, trust=trust, offset=grid.offset)
                commands[part + round((1.0 + late) * PARTS)] = command
        if part % PARTS == 0:
            rows.append((sample.ft, command, sample.velocity))
        torque = commands.pop(part, torque)
        sample = plant.step(torque)
        torques.append(sample.ft)
    n = np.array(rows)
    return ControlTrace(np.arange(len(n)) / rate, np.asarray(desired), n[:, 0], n[:, 1], n[:, 2])


def every(n, **offsets):
    """Return the instants of n measurements; of each 97, some from the 60th on are late by given amounts."""
    taken = np.zeros(n)
    for name, late in offsets.items():
        taken[np.arange(n) % 97 == int(name[1:])] = late
    return taken


def scatter(n):
    """Measurements late by half a Gaussian of 0.3 periods."""
    return np.minimum(0.3 * np.abs(np.random.default_rng(1).normal(size=n)), 0.9)


def thin(n):
    """A tenth of the measurements lost."""
    return np.where(np.random.default_rng(1).random(n) < 0.1, np.nan, 0.0)


KINDS = {
    "one 2.6 periods after the last, then one in time": (lambda n: every(n, _60=1.6), 0.0),
    "one lost, the next 0.6 late, and commands late": (lambda n: every(n, _59=math.nan, _60=0.6), 1.6),
    "a tenth lost": (thin, 0.0),
    "jitter of 0.3 periods": (scatter, 0.0),
    "all commands three late": (np.zeros, 3.0),
}


@pytest.mark.parametrize(("rate", "kind"), [(280.0, kind) for kind in KINDS] + [(1000.0, next(iter(KINDS)))])
def test_irregular_measurements_make_no_kick(rate, kind):
    """A single sample 2.6 periods after the one before made commands of 36 N m where 10 were asked."""
    n = round(1.2 * rate)
    taken, acting = KINDS[kind]
    wanted = 10.0 * np.sin(2.0 * math.pi * 5.0 * np.arange(n) / rate)
    run = irregular(rate, wanted, taken(n), np.full(n, acting))
    settled = run.t > 0.5
    assert np.abs(run.ft[settled]).max() < 13.0
    assert np.abs(run.command[settled]).max() < 0.75 * 68.0


def test_a_torque_sensor_with_its_own_clock_costs_no_accuracy():
    """Torques up to half a sample older than the angles were taken for torques of the same instant."""
    rate, n = 280.0, 560
    wanted = 10.0 * np.sin(2.0 * math.pi * 5.0 * np.arange(n) / rate)
    ages = 0.5 * np.random.default_rng(3).random(n)
    kinds = (np.zeros(n), ages)
    even, aged = (irregular(rate, wanted, np.zeros(n), np.zeros(n), age).error(0.6) for age in kinds)
    assert aged < 1.1 * even


def test_trust_falls_at_once_and_comes_back_slowly():
    lateness = Lateness(280.0)
    assert [lateness.take(0.0), lateness.take(3.0)] == [1.0, 0.0]
    back = [lateness.take(0.0) for _ in range(100)]
    assert back[0] < 0.02 and back[40] < 0.6 and back[-1] == 1.0
    assert lateness.take(1.5) == 1.0 and 0.0 < lateness.take(2.0) < 1.0


def test_n_late_commands_of_m_are_a_fault_and_fewer_are_not():
    lateness = Lateness(280.0, Tolerance(0.5, 1.0))
    for k in range(2000):
        lateness.take(5.0 if k % 3 == 0 else 0.0)
    assert not lateness.persists
    for _ in range(120):
        lateness.take(5.0)
    assert lateness.persists
    lateness.clear()
    assert not lateness.persists


def test_an_error_that_stays_is_a_fault_and_a_step_is_not():
    limits = _controller_limits.ControllerLimits(VALUES)
    assert not any(limits.fault(0.0, 40.0) for _ in range(60))
    assert not any(limits.fault(40.0, 40.0) for _ in range(100))
    faults = [limits.fault(0.0, 40.0) for _ in range(150)]
    assert faults[139] == "" and "40 N·m off the desired torque" in faults[-1]


def test_a_torque_beyond_the_sensor_is_a_fault_at_once():
    assert "ft of -111 N·m" in _controller_limits.ControllerLimits(VALUES).fault(-111.0, -111.0)


def test_a_motor_without_torque_is_noticed_and_a_late_one_is_not():
    """When a fault of the driver was cleared, a torque commanded meanwhile acted: 25 N m in place of 10."""
    limits = _controller_limits.ControllerLimits(VALUES)
    assert [limits.idle(25.0, 0.0) for _ in range(15)].index(True) == 13
    assert not any(limits.idle(25.0, 20.0) or limits.idle(1.0, 0.0) for _ in range(100))
    assert not any(limits.idle(25.0, math.nan) for _ in range(100))
