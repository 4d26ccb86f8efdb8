"""Steps and ramps of known date and size are found; day effects and seasons are no changes."""

from __future__ import annotations

import numpy as np
import pytest
from fleet_histories import DAY, START, history, recordings

from rsea_extras.trends import alarms, fleet_trends
from rsea_extras.trends.result import bin_days, steps_over
from rsea_ros.errors import ParameterError

STIFFNESS = ("a", "spring.stiffness")
NOTHING = recordings(days=1)


def trend(seed, **truth):
    """Return the trend of one joint with some truth."""
    return fleet_trends(history(np.random.default_rng(seed), **truth), NOTHING).trends[STIFFNESS]


def day(time_s):
    return (time_s - START) / DAY


def test_a_step_of_three_day_effects_is_found_at_its_date_with_its_size():
    result = trend(1, course=lambda joint, d: -0.018 * (d >= 120))
    (change,) = result.changes
    assert (result.state, change.kind) == ("changed", "step")
    assert abs(day(change.since_s) - 120.0) <= 3.0
    assert change.size.low < -0.018 * 1500.0 < change.size.high


def test_the_intervals_of_a_steps_date_and_size_hold_the_truth_as_often_as_they_say():
    inside = []
    for seed in range(40):
        result = trend(seed, days=120, each=1, course=lambda joint, d: 0.03 * (d >= 50))
        change = result.changes[0]
        in_dates = day(change.earliest_s) <= 50.0 <= day(change.latest_s) + 1.0
        inside.append((in_dates, change.size.low < 45.0 < change.size.high))
    assert np.all(np.mean(inside, axis=0) > 0.84)  # 95 % of 40, less three standard deviations


def test_wear_is_a_trend_with_its_onset_its_slope_and_the_time_to_its_limit():
    inside = []
    for seed in range(18):
        result = trend(seed, days=200, each=1, course=lambda joint, d: -1e-3 * np.clip(d - 100, 0, None))
        (change,) = result.changes
        assert (result.state, change.kind) == ("trending", "ramp")
        slope, limit = result.per_year, [day(t) for t in result.to_limit_s[1:]]
        inside.append((
            day(change.earliest_s) <= 100.0 <= day(change.latest_s),
            slope.low < -1e-3 * 365.25 * 1500.0 < slope.high,
            limit[0] < 100.0 + 250.0 < limit[1],  # 25 % at 0.1 % a day
        ))  # fmt: skip
    assert np.all(np.mean(inside, axis=0) > 0.79)  # 95 % of 18, less three standard deviations


def test_wear_that_a_new_part_ends_is_two_changes():
    result = trend(1, course=lambda joint, d: np.where(d < 150, -0.1 * np.clip((d - 50) / 100, 0, 1), 0.04))
    assert [c.kind for c in result.changes] == ["ramp", "step"]
    assert abs(day(result.changes[1].since_s) - 150.0) <= 2.0


def test_noise_alone_is_called_a_change_no_oftener_than_stated():
    joints = [f"j{k:03d}" for k in range(150)]
    made = history(np.random.default_rng(5), joints=joints, days=100)
    result = fleet_trends(made, NOTHING)
    assert result.tests == 150
    assert sum(t.state != "steady" for t in result.trends.values()) <= 1


def test_a_large_day_effect_is_not_called_a_change():
    result = trend(2, sd=0.002, day_sd=0.03, each=6, days=60)
    assert result.state == "steady"
    assert 0.02 * 1500.0 < result.day_sd < 0.04 * 1500.0


def season(d, rng):
    return 25.0 + 10.0 * np.sin(2.0 * np.pi * d / 365.0) + 2.0 * rng.normal(size=400)[d]


def test_a_season_is_not_called_wear_and_wear_beside_it_is_found():
    made = history(
        np.random.default_rng(3), joints="abcdef", per_kelvin=-0.003, temperature=season,
        course=lambda joint, d: -0.06 * np.clip((d - 100) / 150, 0, 1) * (joint == "d"),
    )  # fmt: skip
    result = fleet_trends(made, NOTHING)
    states = [t.state for t in result.trends.values()]
    assert states == ["steady"] * 3 + ["trending"] + ["steady"] * 2
    assert result.per_kelvin["spring.stiffness"][0] == pytest.approx(-0.003, rel=0.05)


def test_one_wild_recording_raises_no_alarm():
    made = history(np.random.default_rng(4), days=60)
    made["value"][[40, 119]] *= 3.0
    assert alarms(made, NOTHING) == ()


def test_too_little_excitation_is_a_result_with_its_reason():
    result = trend(0, told=0.02, days=100)
    assert result.state == "undetermined"
    assert "recordings determine it" in result.reason


def test_intervals_as_wide_as_the_value_show_nothing():
    result = trend(0, sd=3.0, days=20)
    assert result.state == "undetermined"
    assert "would show" in result.reason


@pytest.mark.parametrize("since", [4, 8])
def test_a_step_of_a_short_series_is_found_wherever_it_lies(since):
    """Of 12 weekly recordings the last six had 60 % more friction: the page called the joint steady."""
    result = trend(7, days=12, each=1, day_sd=0.0, course=lambda joint, d: 0.6 * (d >= since))
    (change,) = result.changes
    assert (result.state, change.kind) == ("changed", "step")
    assert change.size.low < 0.6 * 1500.0 < change.size.high


def test_noise_of_a_short_series_is_called_a_change_no_oftener_than_stated():
    result = fleet_trends(
        history(np.random.default_rng(6), joints=[f"j{k:03d}" for k in range(300)], days=8), NOTHING
    )
    assert sum(t.state not in ("steady", "undetermined") for t in result.trends.values()) <= 2


def test_dates_at_midnight_on_a_monday_lie_in_their_own_week():
    """A date from a path has no time of day: rounding put it into the week before, and its cell was grey."""
    rng = np.random.default_rng(0)
    made = history(rng, days=12, each=1)
    made["high"] = made["value"] + (made["value"] - made["low"]) * rng.uniform(0.5, 2.0, 12)
    made["time_s"] = (20458.0 + 7.0 * np.arange(12)) * DAY  # Monday, 5 January 2026
    result = fleet_trends(made, NOTHING).trends[STIFFNESS]
    bins = bin_days(result, steps_over(float(made["time_s"][0]), float(made["time_s"][-1])))
    assert len(bins.value) == 12 and np.all(np.isfinite(bins.value))


def test_the_last_recordings_of_a_ramp_count():
    """Its end lies on one side of its neighbours: it was left out, and the level now was two weeks old."""
    made = history(
        np.random.default_rng(2), days=40, each=1, sd=2e-3, day_sd=2e-3,
        course=lambda j, d: 0.02 * np.clip(d - 15, 0, None),
    )  # fmt: skip
    (result,) = fleet_trends(made, NOTHING).trends.values()
    assert day(result.curve.time_s[-1]) >= 39.0
    assert abs(result.now.value - 1500.0 * (1.0 + 0.02 * 24)) < 12.0


@pytest.mark.parametrize("wild", [0, 20, 39])
def test_a_wild_recording_is_left_out_of_a_ramp_and_at_either_end(wild):
    made = history(
        np.random.default_rng(3), days=40, each=1, sd=1e-3, day_sd=1e-3, course=lambda j, d: 0.01 * d
    )
    made["value"][wild] *= 1.5
    (result,) = fleet_trends(made, NOTHING).trends.values()
    assert len(result.by_day.time_s) == 39


def test_a_history_without_a_column_is_refused_by_name():
    made = history(np.random.default_rng(0), days=10)
    del made["low"]
    with pytest.raises(ParameterError, match="history: no column low"):
        fleet_trends(made, NOTHING)


def test_an_empty_store_has_no_trends():
    made = {n: c[:0] for n, c in history(np.random.default_rng(0), days=2).items()}
    result = fleet_trends(made, {n: c[:0] for n, c in NOTHING.items()})
    assert (dict(result.trends), result.appearances, result.outliers) == ({}, (), ())
