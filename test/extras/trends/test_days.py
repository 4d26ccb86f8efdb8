"""Days: their means, outliers, effects of days and temperature equal their definitions written out."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_extras.trends.days import Days, day_effect, day_means, fleet_prior, outliers
from rsea_extras.trends.series import Series, TrendSettings

DAY = 86400.0
S = TrendSettings()


def series(day, value, sd, identifiable=None, temperature=None):
    n = len(value)
    names = np.array([f"bag{k}" for k in range(n)])
    known = np.ones(n, bool) if identifiable is None else np.asarray(identifiable)
    warm = np.full(n, np.nan) if temperature is None else np.asarray(temperature, float)
    return Series("a", "k", "N", DAY * np.asarray(day), np.asarray(value, float),
                  np.broadcast_to(float(sd), n).copy(), known, warm, names, names)  # fmt: skip


def test_the_mean_of_a_day_weights_by_doubt_within_and_between_recordings() -> None:
    """Between recordings of a day: DerSimonian and Laird 1986, their equation 8, group by group."""
    day = [100.2, 100.6, 101.1, 101.9, 102.5, 103.5]
    value, sd = np.array([9.0, 11.0, 10.0, 13.0, 10.0, 77.0]), np.array([0.1, 0.2, 0.1, 0.1, 0.3, 0.1])
    given = series(day, value, 0.0, [True] * 5 + [False], [20.0, 22.0, 24.0, 30.0, np.nan, 90.0])
    given.sd[:] = sd
    days = day_means(given, S)
    value, sd, scale = value[:5], sd[:5], 10.0
    assert (days.scale, days.temperature) == (scale, 24.0)
    y, v = value / scale, (sd / scale) ** 2
    groups = [np.array([0, 1]), np.array([2, 3]), np.array([4])]
    q = room = 0.0
    for g in groups:
        w = 1.0 / v[g]
        mean = np.sum(w * y[g]) / np.sum(w)
        q += np.sum(w * (y[g] - mean) ** 2)
        room += np.sum(w) - np.sum(w**2) / np.sum(w)
    weight = 1.0 / (v + (q - 2) / room)
    warmth = np.array([-4.0, -2.0, 0.0, 6.0, 0.0])
    for k, g in enumerate(groups):
        share = weight[g] / np.sum(weight[g])
        assert days.t[k] == pytest.approx(share @ np.array(day)[g])
        assert days.y[k] == pytest.approx(share @ y[g])
        assert days.warmth[k] == pytest.approx(share @ warmth[g])
        assert days.variance[k] == pytest.approx(1.0 / np.sum(weight[g]))


def test_days_of_alike_recordings_gain_nothing_and_those_of_none_are_empty() -> None:
    alike = day_means(series([1.1, 1.5, 2.5], [-4.0, -4.0, -4.0], 0.04), S)
    np.testing.assert_allclose(alike.variance, [0.5e-4, 1e-4])
    np.testing.assert_allclose(alike.y, [-1.0, -1.0])
    none = day_means(series([1.5], [1.0], 0.1, [False]), S)
    assert (len(none.t), none.scale, none.warmth) == (0, 1.0, None)
    assert day_means(series([1.5, 2.5, 3.5], [0.0, 0.0, 3.0], 0.1), S).scale == 3.0


@pytest.mark.parametrize(
    ("temperature", "warmth"),
    [
        ([20.0, 24.0, np.nan, np.nan], [-2.0, 2.0, 0.0, 0.0]),
        ([20.0, np.nan, np.nan, np.nan], None),
        ([20.0, 20.0, 20.0, 20.0], None),
    ],
)
def test_a_temperature_counts_where_half_is_known_and_it_changes(temperature, warmth) -> None:
    days = day_means(series([1.5, 2.5, 3.5, 4.5], [1.0, 2.0, 3.0, 4.0], 0.1, temperature=temperature), S)
    assert days.warmth == (None if warmth is None else pytest.approx(warmth))


def test_outliers_are_far_from_the_median_and_the_line_of_their_neighbours() -> None:
    rng = np.random.default_rng(3)
    t, noise = DAY * np.arange(20.0), 0.1 * rng.standard_normal(20)
    sd = np.full(20, 0.1)
    lone = noise.copy()
    lone[[4, 19]] += 3.0
    assert np.flatnonzero(outliers(t, lone, sd, 6.0)).tolist() == [4, 19]
    assert not outliers(t, lone, 100.0 * sd, 6.0).any()
    assert not outliers(t[:8], lone[:8], sd[:8], 6.0).any()
    assert np.flatnonzero(outliers(t[:9], lone[:9], sd[:9], 6.0)).tolist() == [4]
    ramp = np.where(np.arange(20) < 10, 0.0, 2.0 * (np.arange(20) - 10)) + 0.01 * noise
    assert not outliers(t, ramp, 0.01 * sd, 6.0).any()
    twice = np.repeat(t[:10], 2)  # two recordings at one time have no line
    assert np.flatnonzero(outliers(twice, lone, sd, 6.0)).tolist() == [4, 19]


def restricted(days: Days, y, blocks, variance) -> tuple[float, float, float]:
    """Return -2 log restricted likelihood, temperature slope and sd by dense matrices (Harville 1974)."""
    n = len(y)
    x = np.array([(np.arange(n) >= a) & (np.arange(n) < b) for a, b in blocks], float).T
    if days.warmth is not None:
        x = np.column_stack([x, days.warmth])
    v = np.diag(days.variance + variance)
    normal = x.T @ np.linalg.solve(v, x)
    b = np.linalg.solve(normal, x.T @ np.linalg.solve(v, y))
    r = y - x @ b
    value = np.linalg.slogdet(v)[1] + np.linalg.slogdet(normal)[1] + r @ np.linalg.solve(v, r)
    return value, b[-1], np.sqrt(np.linalg.inv(normal)[-1, -1])


@pytest.mark.parametrize("is_warm", [False, True])
def test_the_effect_of_a_day_is_that_of_the_greatest_restricted_likelihood(is_warm) -> None:
    rng, n = np.random.default_rng(8), 60
    warmth = 3.0 * rng.standard_normal(n)
    y = 1.0 + 0.05 * rng.standard_normal(n) + 0.3 * (np.arange(n) // 20)
    y += 0.01 * warmth if is_warm else 0.0
    days = Days(np.arange(n) + 0.5, y, rng.uniform(1e-4, 1e-3, n), warmth if is_warm else None, 25.0, 1.0)
    taken = 0.1 * (np.arange(n) >= 30)
    effect = day_effect(days, S, taken)
    blocks = [(a, a + 10) for a in range(0, n, 10)]  # 6, of fewer days than 12 each
    assert effect.freedom == n - len(blocks) - is_warm
    best = restricted(days, y - taken, blocks, effect.variance)
    grid = np.geomspace(1e-5, 1e-1, 200)
    least = min(restricted(days, y - taken, blocks, v)[0] for v in grid)
    assert best[0] < least + 0.05
    if is_warm:
        assert (effect.per_kelvin, effect.per_kelvin_sd) == pytest.approx(best[1:])
        assert effect.per_kelvin == pytest.approx(0.01, abs=0.01)
    else:
        assert (effect.per_kelvin, effect.per_kelvin_sd) == (0.0, np.inf)


def test_long_series_have_blocks_of_a_dozen_days_short_ones_of_four() -> None:
    def freedom(n: int) -> int:
        y = np.random.default_rng(1).standard_normal(n)
        return day_effect(Days(np.arange(float(n)), y, np.full(n, 0.01), None, 0.0, 1.0), S).freedom

    assert [freedom(n) for n in (240, 24, 7, 4)] == [220, 18, 6, 3]
    assert freedom(2) == 1
    few = Days(np.arange(2.0), np.array([1.0, 3.0]), np.full(2, 0.01), None, 0.0, 1.0)
    assert day_effect(few, S, 0.5).variance == 1.0
    alone = Days(np.arange(1.0), np.ones(1), np.full(1, 0.01), None, 0.0, 1.0)
    assert day_effect(alone, S).variance == 0.0


def test_a_scatter_that_intervals_explain_is_no_effect_of_the_day() -> None:
    y = 1e-3 * np.random.default_rng(1).standard_normal(48)
    assert day_effect(Days(np.arange(48.0), y, np.full(48, 0.01), None, 0.0, 1.0), S).variance == 0.0
    wide = day_effect(Days(np.arange(48.0), 1e3 * y, np.full(48, 1e-6), None, 0.0, 1.0), S)
    assert wide.variance == pytest.approx(1.0, rel=0.5)


def test_the_temperature_slope_of_a_fleet_is_that_of_random_effects() -> None:
    """DerSimonian and Laird 1986, equations 8 and 9."""

    def effect(slope, sd):
        return type("E", (), {"per_kelvin": slope, "per_kelvin_sd": sd})()

    slopes, sds = np.array([0.010, 0.014, 0.030]), np.array([0.001, 0.002, 0.004])
    given = [effect(a, b) for a, b in zip(slopes, sds, strict=True)]
    w = sds**-2
    q = np.sum(w * (slopes - np.average(slopes, weights=w)) ** 2)
    between = (q - 2.0) / (np.sum(w) - np.sum(w**2) / np.sum(w))
    w = 1.0 / (sds**2 + between)
    expected = np.average(slopes, weights=w), np.sqrt(between + 1.0 / np.sum(w))
    assert fleet_prior([*given, effect(9.0, np.inf), effect(9.0, 0.0)]) == pytest.approx(expected)
    assert fleet_prior(given[:1]) == (0.0, 0.05)
    assert fleet_prior([effect(0.02, 0.01)] * 2) == pytest.approx((0.02, 0.01 / np.sqrt(2.0)))
