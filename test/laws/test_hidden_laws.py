"""Laws hidden in records of the second bench, which shares no code with the model, are found and sized."""

from __future__ import annotations

import math

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.plant import Plant

import rsea_ros.laws.learn
from rsea_ros.laws.learn import learn
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.law.words import headline

RATIO = Plant().ratio


def test_quadratic_drag_is_a_law_of_speed(learn_of):
    (written,) = learn_of(quadratic_drag=12.0).laws
    (part,) = written.law.parts
    assert (written.law.place, written.law.regressor) == ("gear", "speed")
    assert part.term.name == "quadratic_drag"
    low, high = part.ci95
    assert low - 0.1 < 12.0 < high + 0.1 and high - low < 0.5
    assert written.claims.parity == "odd" and written.claims.passive


def test_a_wave_of_the_output_is_a_law_of_position_with_its_period(learn_of):
    (written,) = learn_of(cogging=1.2, cogging_period=0.004).laws
    law = written.law
    assert (law.place, law.regressor) == ("gear", "position, periodic")
    cycles = 2.0 * math.pi / (0.004 * RATIO)
    assert law.parts[0].shape == pytest.approx(cycles, rel=2e-3)
    assert math.hypot(*(p.coefficient for p in law.parts)) == pytest.approx(1.2, rel=0.05)


def test_a_dead_band_is_a_law_of_the_command(learn_of):
    result = learn_of(deadband=4.0)
    law = result.laws[0].law
    assert law.place in ("command", "motor") and law.regressor == "command"
    assert law.parts[0].shape == pytest.approx(4.0, rel=0.05)
    assert result.gain > 0.5


def test_a_clean_record_yields_nothing(learn_of):
    result = learn_of()
    assert result.laws == () and result.gain == 0.0


def test_the_gain_is_measured_on_blocks_that_took_part_in_nothing(learn_of):
    result = learn_of(quadratic_drag=12.0)
    assert result.gain_ci95[0] < result.gain < result.gain_ci95[1]
    assert all(result.after[n] < 1.3 * result.noise[n] for n in ("ft", "position"))
    assert result.share > 0.95


@pytest.mark.parametrize(("gain", "ci95"), [(0.12, (-0.01, 0.3)), (0.01, (0.005, 0.015))])
def test_a_law_that_is_not_surely_better_is_not_written(monkeypatch, gain, ci95):
    monkeypatch.setattr(rsea_ros.laws.learn, "gain_on_tests", lambda *_: (gain, ci95))
    bench = drawn_bench(np.random.default_rng(3)).with_values(quadratic_drag=12.0)
    result = learn([record_run(bench, 3, "chirp_noise", 4.0)], load_rig("paper_high_impedance"))
    assert result.laws == () and result.gain == 0.0 and result.tried
    assert "no law surely reduces it" in headline(result)
