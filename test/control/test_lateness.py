"""Commands that act late: feedback fades with lateness, and lateness that persists is a fault."""

import math

import numpy as np
import pytest

from rsea_ros.control.controller import Reading, TorqueController
from rsea_ros.control.lateness import Lateness, Tolerance
from rsea_ros.control.law import Gains
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.nodes import _judge

RATES = {280.0: Gains(1.469, 0.01116, 89.2), 1000.0: Gains(19.27, 0.01578, 313.6)}
VALUES = {
    "error_limit": 15.0, "error_time": 0.5, "ft_limit": 110.0, "late_share": 0.5, "late_time": 1.0,
    "rate": 280.0,
}  # fmt: skip


def largest(rate, fade, seed):
    """Largest |ft| and share of commands at the limit, for 10 N m at 5 Hz; bursts of commands 2 to 8 late."""
    dice, lateness = np.random.default_rng(seed), Lateness(rate)
    plant = Plant(load_rig("paper_high_impedance"), rate, seed=seed)
    controller = TorqueController(load_rig("paper_high_impedance"), rate, RATES[rate])
    sample, acting, queue, rows, left, late = plant.step(0.0), 0.0, [], [], 0, 0
    for k in range(round(3.0 * rate)):
        if left <= 0:
            left, late = dice.geometric(0.2), dice.choice((0, dice.integers(2, 9)))
        left -= 1
        reading = Reading(sample.ft, sample.velocity, sample.position, sample.motor_torque)
        how = {"trust": lateness.take(late)} if fade else {"late": late > 1}
        torque = controller.step(reading, 10.0 * math.sin(2.0 * math.pi * 5.0 * k / rate), **how)
        queue.append((max(k + 1 + late, queue[-1][0] if queue else 0), torque))
        rows.append((abs(sample.ft), abs(torque) > 67.9))
        while queue and queue[0][0] <= k:
            acting = queue.pop(0)[1]
        sample = plant.step(acting)
    ft, limited = np.array(rows)[round(rate) :].T
    return ft.max(), limited.mean()


@pytest.mark.parametrize("rate", RATES)
def test_feedback_that_fades_swings_nothing_up(rate):
    for seed in (1, 2):
        ft, limited = largest(rate, True, seed)
        assert ft < 13.0 and limited == 0.0


def test_feedback_on_and_off_is_bang_bang_at_the_limit():
    """What this is for: 68 N m where 10 are asked, a third of the commands at the limit."""
    assert max(largest(1000.0, False, seed)[0] for seed in (1, 2)) > 30.0


def test_trust_falls_at_once_and_comes_back_slowly():
    lateness = Lateness(280.0)
    assert [lateness.take(0.0), lateness.take(3.0)] == [1.0, 0.0]
    back = [lateness.take(0.0) for _ in range(100)]
    assert back[0] < 0.02 and back[40] < 0.6 and back[-1] == 1.0
    assert 0.0 < lateness.take(1.0) < 1.0


def test_n_late_of_m_are_a_fault_and_a_few_are_none():
    lateness = Lateness(280.0, Tolerance(0.5, 1.0))
    for k in range(2000):
        lateness.take(5.0 if k % 3 == 0 else 0.0)
    assert not lateness.persists
    for _ in range(120):
        lateness.take(5.0)
    assert lateness.persists
    lateness.clear()
    assert not lateness.persists


def test_an_error_that_stays_is_a_fault_and_a_step_is_none():
    judge = _judge.Judge(VALUES)
    assert not any(judge.fault(0.0, 40.0) for _ in range(60))
    assert not any(judge.fault(40.0, 40.0) for _ in range(100))
    faults = [judge.fault(0.0, 40.0) for _ in range(150)]
    assert faults[139] == "" and "40 N m off the desired torque" in faults[-1]


def test_a_torque_beyond_the_sensor_is_a_fault_at_once():
    assert "ft of -111 N m" in _judge.Judge(VALUES).fault(-111.0, -111.0)


def test_a_motor_that_makes_nothing_is_seen_and_one_that_is_late_is_not():
    """A driver with a fault: what was commanded meanwhile, 25 N m for 10, came when that was cleared."""
    judge = _judge.Judge(VALUES)
    assert [judge.idle(25.0, 0.0) for _ in range(15)].index(True) == 13
    assert not any(judge.idle(25.0, 20.0) or judge.idle(1.0, 0.0) for _ in range(100))
    assert not any(judge.idle(25.0, math.nan) for _ in range(100))
