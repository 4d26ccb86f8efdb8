"""Each fault of samples at its limit and just beyond, by numbers small enough to count by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.checks.faults import clipping, coarse, not_finite, outliers
from rsea_ros.checks.frozen import frozen_samples
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import BoolArray, Channel


def channel(values: object, rate: float = 100.0) -> Channel:
    y = np.asarray(values, float)
    return Channel(np.arange(len(y)) / rate, y)


def where(marked: BoolArray) -> list[int]:
    return np.flatnonzero(marked).tolist()


def teeth(count: int = 60, **at: float) -> Channel:
    """Return 0, 1, 0, 1, …: of the ten around a 0 six are 1, so it is 12 spreads of 1 from 1 or further."""
    y = np.arange(count) % 2.0
    for name, value in at.items():
        y[int(name.removeprefix("at"))] = value
    return channel(y)


@pytest.mark.parametrize(
    ("made", "marked"),
    [
        (teeth(at30=13.0), []), (teeth(at30=13.1), [30]), (teeth(at30=-11.0), []), (teeth(at30=-11.1), [30]),
        (teeth(at31=12.0), []), (teeth(at31=12.1), [31]), (teeth(at31=-12.0), []), (teeth(at31=-12.1), [31]),
        (teeth(at30=20.0, at31=20.0), [30, 31]), (teeth(at30=20.0, at31=-20.0), [30, 31]),
        (teeth(at29=20.0, at30=20.0, at31=20.0, at32=20.0), []),
        (teeth(at0=20.0), [0]), (teeth(at59=-20.0), [59]), (teeth(at20=np.nan, at30=13.1), [30]),
        (teeth(19, at9=20.0), []), (teeth(20, at9=20.0), [9]),
    ],
)  # fmt: skip
def test_an_outlier_is_further_than_twelve_spreads_from_those_around_it(made, marked) -> None:
    assert where(outliers(made, "ft")) == marked
    assert not outliers(made, "command").any()


def risen(extreme: int, inside: int = 0, apart: bool = False) -> Channel:
    """Return 100 values below 1, no two alike, so many of them at 1 in the middle, and so many just below."""
    y = np.random.default_rng(3).permutation(np.linspace(-1.0, 0.9, 100))
    y[40 : 40 + extreme * (1 + apart) : 1 + apart] = 1.0
    y[5 : 5 + 2 * inside : 2] = 0.95
    return channel(y)


@pytest.mark.parametrize(
    ("made", "count"),
    [(risen(7), 0), (risen(8), 8), (risen(12), 12), (risen(12, apart=True), 0), (risen(8, inside=2), 8),
     (risen(8, inside=3), 0), (risen(12, inside=3), 12)],
)  # fmt: skip
def test_many_samples_in_a_row_at_the_extreme_are_clipping(made, count) -> None:
    assert where(clipping(made, "ft")) == where(made.y == 1.0) * (count > 0)
    below = Channel(made.t, -made.y)
    assert np.count_nonzero(clipping(below, "position")) == count
    assert not any(clipping(made, name).any() for name in ("command", "reference", "motor_torque"))


def test_a_motion_that_slows_down_to_its_end_is_no_clipping() -> None:
    """It comes to its extreme by steps a hundredth of the usual ones; a limit cuts it off at full speed."""
    rise = np.concatenate([np.arange(0.0, 1.0, 0.1), 1.0 - 0.1 * 0.5 ** np.arange(1, 12)])
    rest = np.full(12, 1.0)
    slow = np.concatenate([rise, rest, rise[::-1]])
    assert not clipping(channel(slow), "position").any()
    quick = np.concatenate([rise[:10], rest, rise[9::-1]])
    assert where(clipping(channel(quick), "position")) == list(range(10, 22))


@pytest.mark.parametrize(("times", "told"), [(4.9, False), (5.1, True)])
def test_steps_five_times_as_large_as_the_sensors_are_told(times, told) -> None:
    rig = load_rig("paper_high_impedance")
    sensor = rig.sensors["ft"]
    step = times * max(sensor.noise, sensor.quantum)
    values = step * np.random.default_rng(1).integers(-20, 20, 2000)
    assert bool(coarse(channel(values), "ft", rig)) == told
    assert where(not_finite(channel([0.0, np.nan, np.inf, -np.inf, 1.0]), "ft")) == [1, 2, 3]


def held(*runs: tuple[int, int]) -> Channel:
    """Return 1000 samples with steps from 50.95 to 1, ten of them below 1.5, and repeats in runs."""
    y = np.cumsum(np.linspace(50.95, 1.0, 1000) * (-1.0) ** np.arange(1000))
    for first, repeats in runs:
        y[first : first + repeats + 1] = y[first]
    return channel(y)


def evenly(count: int, repeats: int) -> list[tuple[int, int]]:
    return [(100 * k, repeats) for k in range(count)]


@pytest.mark.parametrize(
    ("runs", "marked"),
    [([(100, 28)], 0), ([(100, 30)], 30), (evenly(7, 44), 308), (evenly(7, 46), 0),
     ([*evenly(7, 46), (800, 48)], 0), ([*evenly(7, 46), (800, 50)], 50)],
)  # fmt: skip
def test_more_repeats_than_chance_makes_are_frozen(runs, marked) -> None:
    """Of ten smallest steps chance makes five repeats: n - 7.5 - 3 sqrt(n) from 5 on are too many, up to 250,
    when the log is faster than the sensor; half a second is too long in any case."""
    made = held(*runs)
    assert np.count_nonzero(frozen_samples(made, "ft")) == marked
    assert not frozen_samples(made, "command").any() and not frozen_samples(made, "reference").any()
