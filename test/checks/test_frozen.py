"""What repeats while the machine moved is frozen; what repeats at rest, or by a quantum, is sound."""

import numpy as np
import pytest

from rsea_ros.checks.frozen import (
    frozen_samples,
    held_in_motion,
    longest,
    simultaneous_holds,
    while_others_moved,
)
from rsea_ros.records.record import Channel, Record

RATE = 200.0
T = np.arange(2400) / RATE


def moving(seed: int = 2) -> Record:
    """Return a machine that swings by a sine of 1 Hz, with noise in every sensor."""
    rng = np.random.default_rng(seed)
    angle = 0.1 * np.sin(2.0 * np.pi * T)
    made = {
        "command": 30.0 * np.sin(2.0 * np.pi * T + 0.3), "position": angle,
        "velocity": 0.2 * np.pi * np.cos(2.0 * np.pi * T), "ft": 150.0 * angle,
    }  # fmt: skip
    size = {"position": 1e-5, "velocity": 5e-3, "ft": 0.05, "command": 0.0}
    return Record({n: Channel(T, y + size[n] * rng.standard_normal(len(T))) for n, y in made.items()})


def freeze(record: Record, name: str, first: int, end: int) -> Record:
    """Return the record with a channel that repeats, in [first, end), the value before."""
    y = record[name].y.copy()
    y[first:end] = y[first - 1]
    return record.with_channels(**{name: Channel(record[name].t, y)})


def rows(first: int, end: int) -> list[int]:
    return list(range(first, end))


@pytest.mark.parametrize(
    ("names", "marked"), [(("ft", "velocity"), True), (("ft",), False), (("ft", "command"), False)]
)
def test_two_sensors_that_hold_at_once_while_the_command_changes_are_frozen(names, marked) -> None:
    record = moving()
    for name in names:
        record = freeze(record, name, 1000, 1100)
    found = simultaneous_holds(record, "ft")
    assert np.flatnonzero(found).tolist() == rows(1000, 1100) * marked
    still = record.with_channels(
        command=Channel(T, np.where((T > 4.9) & (T < 5.6), 1.0, record["command"].y))
    )
    assert not simultaneous_holds(still, "ft").any(), "the command changes in less than 80 % of it"


@pytest.mark.parametrize(
    ("repeats", "noise", "marked"), [(19, 9.0, False), (21, 9.0, True), (41, 0.8, True), (41, 0.5, False)]
)
def test_a_hold_is_long_from_twenty_samples_on_of_a_noise_that_shows(repeats, noise, marked) -> None:
    """noise: of ft, in steps between its values; a smaller one may repeat a value at standstill."""
    record, step = moving(), 0.05 / noise
    record = record.with_channels(ft=Channel(T, step * np.round(record["ft"].y / step)))
    record = freeze(freeze(record, "ft", 1000, 1000 + repeats), "velocity", 1000, 1000 + repeats)
    assert simultaneous_holds(record, "ft").any() == marked


@pytest.mark.parametrize(("first", "end"), [(990, 1030), (1000, 1006), (1000, 1003)])
def test_a_position_that_catches_up_by_a_jump_had_frozen(first, end) -> None:
    """Fewer than five repeats are alike by its steps; a joint that stood makes no jump."""
    found = held_in_motion(freeze(moving(), "position", first, end))
    assert np.flatnonzero(found).tolist() == rows(first, end) * (end - first >= 5)
    record, stands = moving(), (T > 4.0) & (T < 4.3)
    velocity = Channel(T, np.where(stands, 0.0, record["velocity"].y))
    still = freeze(record, "position", 801, 860).with_channels(velocity=velocity)
    assert not held_in_motion(still).any()
    assert not held_in_motion(Record({"position": record["position"]})).any()


def test_a_velocity_that_holds_is_frozen_where_the_position_went_otherwise() -> None:
    record = freeze(moving(), "velocity", 1040, 1200)
    suspect = np.diff(record["velocity"].y, prepend=np.nan) == 0.0
    found = while_others_moved(record, "velocity", suspect, "frozen_samples")
    assert np.flatnonzero(found).tolist() == rows(1040, 1200)
    steady = record.with_channels(
        position=Channel(T, record["velocity"].y[1039] * T),
        velocity=freeze(record, "velocity", 1040, 1200)["velocity"],
    )
    assert not while_others_moved(steady, "velocity", suspect, "frozen_samples").any()


@pytest.mark.parametrize(("first", "end", "told"), [(200, 300, ""), (200, 301, "at 3 from 1 s to 1.5 s")])
def test_a_run_of_half_a_second_is_told(first, end, told) -> None:
    marked = np.zeros(len(T), bool)
    marked[first:end] = marked[10:20] = True
    assert longest(Channel(T, np.full(len(T), 3.0)), marked) == told
    assert longest(Channel(T, T), np.zeros(len(T), bool)) == ""


def held(*runs: tuple[int, int]) -> Channel:
    """Return 1000 samples with steps from 50.95 to 1, ten of them below 1.5, and repeats in runs."""
    y = np.cumsum(np.linspace(50.95, 1.0, 1000) * (-1.0) ** np.arange(1000))
    for first, repeats in runs:
        y[first : first + repeats + 1] = y[first]
    return Channel(np.arange(1000) / 100.0, y)


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
