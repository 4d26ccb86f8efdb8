"""Laws hidden in records of the second bench, which shares no code with the model, are found and sized."""

import math

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.excitations import chirp_noise
from independent.plant import Plant
from runs import RATE, RIG

import rsea_ros.laws.learn
from rsea_ros import simulate
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import lend
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import Port
from rsea_ros.laws.learn import learn
from rsea_ros.report.law import headline

RATIO = Plant().ratio


def test_quadratic_drag_is_a_law_of_speed(learn_of):
    (written,) = learn_of(quadratic_drag=12.0).laws
    (part,) = written.law.parts
    assert (written.law.place, written.law.regressor) == ("gear", "speed")
    assert part.term.name == "quadratic_drag"
    low, high = part.ci95
    assert low - 0.1 < 12.0 < high + 0.1 and high - low < 0.5
    assert written.claims.parity == "odd" and written.claims.passive


def test_the_gain_is_measured_on_blocks_that_took_part_in_nothing(learn_of):
    result = learn_of(quadratic_drag=12.0)
    assert result.gain_ci95[0] < result.gain < result.gain_ci95[1]
    assert all(result.after[n] < 1.3 * result.noise[n] for n in ("ft", "position"))
    assert result.share > 0.95


@compiled
def wavy_spring(s, p, x):
    """Add p[0] d sin(900 d) to the torque of a spring of deflection d, rad."""
    s[st.SPRING_TORQUE] += p[0] * s[st.DEFLECTION] * math.sin(900.0 * s[st.DEFLECTION])


def test_a_stiffness_that_repeats_is_one_law_of_its_period():
    change = Parameter("change", "N m/rad", 0.0, -1e3, 1e3, 300.0)
    claims = Claims("deflection", "neither", None)
    effect = Effect("wavy", Port.SPRING, (change,), claims, wavy_spring, reads=(st.DEFLECTION,))
    command = chirp_noise(4.0, np.random.default_rng(5))
    with lend(effect):
        record = simulate(RIG.with_effect("wavy", change=300.0), command, RATE, seed=5)
    (written,) = learn([record], RIG).laws
    (part,) = written.law.parts
    assert written.law.regressor == "deflection and position, periodic"
    assert abs(part.coefficient) == pytest.approx(300.0, rel=0.05)
    assert part.shape * RATIO == pytest.approx(900.0, rel=0.02)


def test_a_dead_band_is_a_law_of_the_command(learn_of):
    result = learn_of(deadband=4.0)
    law = result.laws[0].law
    assert law.place in ("command", "motor") and law.regressor == "command"
    assert law.parts[0].shape == pytest.approx(4.0, rel=0.05)
    assert result.gain > 0.5


def test_a_clean_record_yields_nothing(learn_of):
    result = learn_of()
    assert result.laws == () and result.gain == 0.0


def test_a_law_that_is_not_surely_better_is_not_written(monkeypatch):
    monkeypatch.setattr(rsea_ros.laws.learn, "gain_of", lambda *_: (0.12, (-0.01, 0.3)))
    monkeypatch.setattr(rsea_ros.laws.learn, "refined_laws", lambda base, drafts: base)
    bench = drawn_bench(np.random.default_rng(3)).with_values(quadratic_drag=12.0)
    result = learn([record_run(bench, 3, "chirp_noise", 3.0)], RIG)
    assert result.laws == () and result.gain == 0.0 and result.tried
    assert "no law surely reduces it" in headline(result)
