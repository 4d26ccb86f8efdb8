"""Late measurements and commands: their place in the grid, feedback that fades with them, and faults."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control.controller import TorqueController
from rsea_ros.control.following import ControlTrace, reading
from rsea_ros.control.grid import Grid, Lateness, Tolerance
from rsea_ros.model.simulation import Plant
from rsea_ros.nodes._control import ControllerLimits
from test.control.benches import FAST, GAINS_AT, RATE, RIG, wave

PERIOD = 1e9 / RATE


@pytest.mark.parametrize(
    ("at", "counted"),
    [
        ((0.0, 1.6, 2.0, 3.0), [1, 1, 1, 1]),  # rounding counted 2 and 0 or 2 and 1, and divided by zero
        ((0.0, 1.4, 2.0, 3.0), [1, 1, 1, 1]),
        ((0.0, 1.0, 3.0, 4.0), [1, 1, 2, 1]),  # a lost one, once
        ((0.0, 1.0, 1.1, 2.0), [1, 1, 0, 1]),  # two of one period
    ],
)
def test_a_grid_counts_the_periods_between_measurements(at, counted):
    """at: the instants, in periods."""
    grid = Grid(PERIOD)
    assert [grid.place(round((100.0 + each) * PERIOD)) for each in at] == counted


@pytest.mark.parametrize("off", [-5e-4, 0.0, 5e-4])
def test_lateness_of_any_kind_never_lets_the_model_run_ahead(off):
    """A tenth of the cycles late by up to a period, on a clock that is 500 ppm off."""
    dice, grid, steps = random.Random(1), Grid(PERIOD), 0
    for k in range(5000):
        late = dice.random() if dice.random() < 0.1 else 0.02 * dice.random()
        steps += grid.place(round((k * (1.0 + off) + late) * PERIOD))
    assert abs(steps - 5000) <= 1


def test_a_jump_of_the_stamps_is_reported_and_not_counted():
    grid = Grid(PERIOD)
    grid.place(10**18)
    for jump in (-3600 * 10**9, 3600 * 10**9):
        assert grid.jumps(10**18 + jump)
    assert not grid.jumps(10**18 + round(20 * PERIOD))


def test_feedback_that_fades_with_lateness_stays_stable():
    """10 N m at 5 Hz, with bursts of commands that come 2 to 8 samples late."""
    dice, lateness = np.random.default_rng(1), Lateness(RATE)
    plant, controller = Plant(RIG, RATE, seed=1), TorqueController(RIG, RATE, GAINS_AT[RATE])
    sample, acting, queue, rows, left, late = plant.step(0.0), 0.0, [], [], 0, 0
    for k in range(round(3.0 * RATE)):
        if left <= 0:
            left, late = dice.geometric(0.2), dice.choice((0, dice.integers(2, 9)))
        left -= 1
        torque = controller.step(reading(sample), wave(k), trust=lateness.take(late))
        queue.append((max(k + 1 + late, queue[-1][0] if queue else 0), torque))
        rows.append((sample.ft, torque))
        while queue and queue[0][0] <= k:
            acting = queue.pop(0)[1]
        sample = plant.step(acting)
    ft, sent = np.abs(rows)[round(RATE) :].T
    assert ft.max() < 13.0 and sent.max() <= 67.9


PARTS = 5
"""Of a period, between which the simulation distinguishes instants."""
LONG_AGO = 10**12
"""ns, stamp of the first measurement."""


def irregular(rate, desired, taken, acting=0.0, ft_age=0.0):
    """Run a controller on a simulated rig with measurements and commands that come when they come.

    As the node does it: a grid gives each stamp its place, lateness fades the feedback. Held to a part
    PARTS of a period. In periods: taken: by how much each measurement is taken after its place; nan for one
    that is lost. acting: by how much commands act after their sample. ft_age: by how much the torque of each
    sample is older than the rest of it.
    """
    controller = TorqueController(RIG, rate, GAINS_AT[rate])
    plant, grid, lateness = Plant(RIG, rate * PARTS), Grid(1e9 / rate), Lateness(rate)
    due = {round((k + off) * PARTS): k for k, off in enumerate(taken) if np.isfinite(off)}
    commands, ages, numbers = {}, np.broadcast_to(ft_age, len(desired)), np.arange(len(desired))
    rows, torque, command, sample = [], 0.0, 0.0, plant.step(0.0)
    torques = [sample.ft]
    controller.start(reading(sample), float(desired[0]))
    for part in range(len(desired) * PARTS):
        if part in due:
            periods = grid.place(round(part / PARTS / rate * 1e9 + LONG_AGO))
            trust = lateness.take(max(acting, periods - 1), max(1, periods))
            if periods:
                wanted = float(np.interp((grid.at - LONG_AGO) * 1e-9 * rate, numbers, desired))
                back = min(round(ages[due[part]] * PARTS), part)
                read = replace(reading(sample), ft=torques[part - back], ft_age=back / PARTS)
                command = controller.step(read, wanted, periods - 1, trust=trust, offset=grid.offset)
                commands[part + round((1.0 + acting) * PARTS)] = command
        if part % PARTS == 0:
            rows.append((sample.ft, command, sample.velocity))
        torque = commands.pop(part, torque)
        sample = plant.step(torque)
        torques.append(sample.ft)
    return ControlTrace(np.arange(len(rows)) / rate, np.asarray(desired), *np.array(rows).T)


def every_97th(n, offsets):
    """Return the instants of n measurements, of which some of each 97 are late."""
    taken = np.zeros(n)
    for place, late in offsets.items():
        taken[np.arange(n) % 97 == place] = late
    return taken


KINDS = {
    "one 2.6 periods after the last, then one in time": (lambda n, dice: every_97th(n, {60: 1.6}), 0.0),
    "one lost, the next 0.6 late, and commands late": (
        lambda n, dice: every_97th(n, {59: math.nan, 60: 0.6}), 1.6,
    ),
    "jitter of 0.3 periods": (lambda n, dice: np.minimum(0.3 * np.abs(dice.normal(size=n)), 0.9), 0.0),
    "all commands three late": (lambda n, dice: np.zeros(n), 3.0),
}  # fmt: skip


@pytest.mark.parametrize(("rate", "kind"), [(RATE, kind) for kind in KINDS] + [(FAST, next(iter(KINDS)))])
def test_irregular_measurements_make_no_kick(rate, kind):
    """A single sample 2.6 periods after the one before made commands of 36 N m where 10 were asked."""
    n, (taken, acting) = round(1.2 * rate), KINDS[kind]
    wanted = 10.0 * np.sin(2.0 * math.pi * 5.0 * np.arange(n) / rate)
    run = irregular(rate, wanted, taken(n, np.random.default_rng(1)), acting)
    settled = run.t > 0.5
    assert np.abs(run.ft[settled]).max() < 13.0
    assert np.abs(run.command[settled]).max() < 0.75 * 68.0


def test_a_torque_sensor_with_its_own_clock_costs_no_accuracy():
    """Torques up to half a sample older than the angles were taken for torques of the same instant."""
    n = 560
    wanted = 10.0 * np.sin(2.0 * math.pi * 5.0 * np.arange(n) / RATE)
    ages = 0.0, 0.5 * np.random.default_rng(3).random(n)
    even, aged = (irregular(RATE, wanted, np.zeros(n), ft_age=age).error(0.6) for age in ages)
    assert aged < 1.1 * even


def test_trust_falls_at_once_and_comes_back_slowly():
    lateness = Lateness(RATE)
    assert [lateness.take(0.0), lateness.take(3.0)] == [1.0, 0.0]
    back = [lateness.take(0.0) for _ in range(100)]
    assert back[0] < 0.02 and back[40] < 0.6 and back[-1] == 1.0
    assert lateness.take(1.5) == 1.0 and 0.0 < lateness.take(2.0) < 1.0


def test_n_late_commands_of_m_are_a_fault_and_fewer_are_not():
    lateness = Lateness(RATE, Tolerance(0.5, 1.0))
    for k in range(2000):
        lateness.take(5.0 if k % 3 == 0 else 0.0)
    assert not lateness.persists
    for _ in range(120):
        lateness.take(5.0)
    assert lateness.persists
    lateness.clear()
    assert not lateness.persists


@pytest.fixture
def limits():
    return ControllerLimits({
        "error_limit": 15.0, "error_time": 0.5, "ft_limit": 110.0, "late_share": 0.5, "late_time": 1.0,
        "rate": RATE, "rig": RIG.name,
    })  # fmt: skip


def test_an_error_that_stays_is_a_fault_and_a_step_is_not(limits):
    assert not any(limits.fault(0.0, 40.0) for _ in range(60))
    assert not any(limits.fault(40.0, 40.0) for _ in range(100))
    faults = [limits.fault(0.0, 40.0) for _ in range(150)]
    assert faults[139] == "" and "40 N·m off the desired torque" in faults[-1]
    assert "ft of -111 N·m" in limits.fault(-111.0, -111.0), "beyond the sensor, at once"


def test_a_motor_without_torque_is_noticed_and_a_late_one_is_not(limits):
    """When a fault of the driver was cleared, a torque commanded meanwhile acted: 25 N m in place of 10."""
    assert [limits.idle(25.0, 0.0) for _ in range(15)].index(True) == 13
    assert not any(limits.idle(25.0, 20.0) or limits.idle(1.0, 0.0) for _ in range(100))
    assert not any(limits.idle(25.0, math.nan) for _ in range(100))
