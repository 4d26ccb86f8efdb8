"""Figures show the values, and hold no number that JSON cannot hold; packed traces come back."""

import base64
import gzip

import numpy as np
import pytest

from rsea_ros.diagnosis.residual_analysis import by_frequency
from rsea_ros.report.figures.figure import AFTER, BEFORE, Curve, line
from rsea_ros.report.figures.overlay import MOST_SAMPLES, extremes, overlay_figure, pack, pauses_of, without
from rsea_ros.report.figures.spectrum import density, residual_figure


@pytest.mark.parametrize("stamps", ["even", "rounded", "lost", "paused"])
def test_a_line_and_the_floor_of_a_density_are_read_off_the_stamps(stamps: str) -> None:
    """50 Hz stood at 44.6 where stamps of 280 Hz were rounded to 2 ms, at 55.5 where a tenth was lost."""
    rng, t = np.random.default_rng(2), np.arange(60_000) / 280.0
    keep = {"lost": rng.random(len(t)) > 0.1, "paused": (t < 20.0) | (t > 140.3)}.get(stamps, t >= 0.0)
    t = t[keep]
    values = 0.3 * rng.standard_normal(len(t)) + 0.3 * np.sin(2.0 * np.pi * 50.0 * t)
    stamped = np.round(t / 2e-3) * 2e-3 if stamps == "rounded" else t
    rate, frequency, level = density(stamped, values)
    assert rate == pytest.approx(280.0, rel=1e-3)
    assert frequency[np.argmax(level)] == pytest.approx(50.0, abs=0.05)
    floor = np.abs(frequency - 50.0) > 1.0
    assert np.sqrt(np.mean(level[floor] ** 2)) == pytest.approx(0.3 / np.sqrt(140.0), rel=0.07)
    worst = max(by_frequency(stamped, values, 0.3, "ft"), key=lambda m: m.times_noise)
    assert worst.low < 50.0 < worst.high


def test_long_traces_keep_their_extremes() -> None:
    y = np.random.default_rng(5).standard_normal(500_000)
    residual = 0.01 * y
    y[123_456], residual[333_333] = 50.0, -9.0
    keep = extremes(MOST_SAMPLES, y, residual)
    assert len(keep) <= MOST_SAMPLES
    assert 123_456 in keep
    assert 333_333 in keep
    assert np.all(np.diff(keep) > 0)


def test_a_pause_of_the_samples_is_not_drawn_and_keeps_its_length() -> None:
    """Between two stretches of a long record lies a minute without a sample."""
    t = np.concatenate([np.arange(300) / 280.0, 60.0 + np.arange(300) / 280.0])
    assert pauses_of(np.array([0.0, 2.0, 4.0, 8.0])) == {}
    ((at, seconds),) = pauses_of(t).items()
    assert (at, seconds) == (300, pytest.approx(60.0 - 299.0 / 280.0))
    joined = np.diff(without({at: seconds}, t))[298:301]
    np.testing.assert_allclose(joined, [1.0 / 280.0, 0.0, 1.0 / 280.0], atol=1e-12)
    figure = overlay_figure(
        "Paused", "F/T torque", "N·m", t, np.sin(t), [Curve("simulated", BEFORE, 0.9 * np.sin(t))]
    )
    assert figure.extra["pauses"] == [(at, seconds)]
    assert figure.extra["t"]["step"] < 2e-6


def test_a_curve_without_a_unit_under_the_pointer_is_refused() -> None:
    """Control, design and experiment showed pairs of bare numbers there."""
    ones = np.ones(3)
    with pytest.raises(ValueError, match="line 'run' has no hovertemplate"):
        line(ones, ones, "run", AFTER)
    assert line(ones, ones, "run", AFTER, hovertemplate="%{y:.3g} N·m")["hovertemplate"].endswith("N·m")


def test_every_curve_is_named_beside_the_figure_in_its_colour() -> None:
    """Centred above a peak at 0.4 Hz a name lay on the marks of the axis, on a phone."""
    frequency = np.linspace(0.1, 139.0, 500)
    curve = Curve("measured", AFTER, 1.0 + np.exp(-((frequency - 0.4) ** 2)))
    drawn = residual_figure("t", "ft", frequency, [curve], 1e-2)
    names = drawn.layout["annotations"]
    assert [n["text"] for n in names] == ["<b>measured</b>", "noise floor"]
    assert names[0]["font"]["color"] == AFTER and all(n["x"] > 1.0 and n["xref"] == "paper" for n in names)
    assert "N·m/√Hz" in drawn.data[1]["hovertemplate"]


def unpack(values):
    """Unpack as page.js does."""
    planes = np.frombuffer(gzip.decompress(base64.b64decode(values["data"])), np.uint8).astype(int)
    low, high = np.split(planes, 2)
    whole = low + 256 * high
    back = values["first"] + values["slope"] * np.arange(len(whole)) + values["step"] * whole
    return np.where(whole == 65535, np.nan, back)


@pytest.mark.parametrize("step", [0.0, 0.01])
def test_values_come_back_to_half_a_step(step):
    values = 1e3 + np.cumsum(np.random.default_rng(1).standard_normal(5000))
    small = pack(values, step)
    assert small["step"] == pytest.approx(max(step, small["step"]))
    assert unpack(small) == pytest.approx(values, abs=0.501 * small["step"])
    assert small["step"] <= max(step, np.ptp(values) / 30_000)


@pytest.mark.parametrize("values", [[], [3.0], [2.0, 2.0], [np.nan, 1.0, 2.0], [np.nan, np.nan]])
def test_short_and_broken_traces_come_back(values):
    assert unpack(pack(np.array(values))) == pytest.approx(values, nan_ok=True, abs=1e-4)
