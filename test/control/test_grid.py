"""Measurements are placed on their grid by their stamps: late ones and lost ones."""

import random

import pytest

from rsea_ros.control.grid import Grid

PERIOD = 1e9 / 280.0


def place(*periods):
    """Return the periods that a grid counts between measurements at these instants (in periods)."""
    grid = Grid(PERIOD)
    return [grid.place(round((100.0 + at) * PERIOD)) for at in periods]


def test_one_late_cycle_and_one_in_time_are_two_periods():
    """Rounding counted 2 and 0 or 2 and 1, and divided by zero."""
    assert place(0.0, 1.6, 2.0, 3.0) == [1, 1, 1, 1]
    assert place(0.0, 1.4, 2.0, 3.0) == [1, 1, 1, 1]


def test_a_lost_cycle_is_counted_once():
    assert place(0.0, 1.0, 3.0, 4.0) == [1, 1, 2, 1]


def test_two_measurements_of_one_period_are_one_step():
    assert place(0.0, 1.0, 1.1, 2.0) == [1, 1, 0, 1]
    assert sum(place(0.0, 1.9, 2.0, 3.0)) == 4


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
