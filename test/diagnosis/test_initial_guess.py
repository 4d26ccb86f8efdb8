"""Where fits of effects begin, and times within the error of the clocks, which are no effects."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.candidate import is_at_bound
from rsea_ros.diagnosis.initial_guess import RecordView, initial_guesses
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import MEASURED, Channel


@pytest.fixture(scope="module")
def view():
    """A record beside a model whose values are 10 % off."""
    rig = load_rig("paper_high_impedance")
    command = excitation("multisine", ExcitationSettings(rate=280.0, duration=4.0, period=4.0))
    record = synthesize(rig, Channel(np.arange(len(command)) / 280.0, command), seed=3)
    case, wrong = case_from(record, rig), rig.with_values({n: 1.1 * rig[n] for n in rig.free()})
    (outputs,) = Problem((case,), wrong, (), MEASURED).outputs(np.zeros(0))
    return RecordView(case, wrong, outputs)


@pytest.mark.parametrize("name", catalogue())
def test_guesses_name_all_parameters_and_values_of_the_rig(name, view):
    effect = effect_named(name)
    parameters = {p.name: p for p in effect.parameters}
    for guess in initial_guesses(effect, view):
        assert set(parameters) <= set(guess) <= set(parameters) | set(view.free)
        assert all(np.isfinite(value) for key, value in guess.items() if key not in effect.null)
        assert effect.vector({p: guess[p] for p in parameters})


def test_a_guess_from_the_residual_comes_before_the_typical_size(view):
    """A limit below the largest command, a constant by which the F/T torque is off."""
    limits = [g["limit"] for g in initial_guesses(effect_named("torque_saturation"), view)]
    assert max(limits) <= 1.01 * view.largest_command()
    (guess,) = initial_guesses(effect_named("torque_constant_error"), view)
    assert guess["gain"] == pytest.approx(view.gain("ft"))
    assert guess["spring.stiffness"] == pytest.approx(view.value("spring.stiffness") * guess["gain"])


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("current_loop_lag", 2.5e-5, True),
        ("command_delay", 1.5e-4, True),
        ("current_loop_lag", 1e-3, False),
        ("command_delay", 1.2e-3, False),
        ("coulomb_friction", 1e-4, False),
    ],
)
def test_a_time_that_a_clocks_error_may_make_is_at_its_bound(name, value, expected):
    effect = effect_named(name)
    unknowns = unknowns_of_effect(effect, {**effect.typical, effect.main.name: value})
    problem = Problem((), load_rig("paper_high_impedance"), unknowns, ("ft", "position"))
    solution = Solution(problem, start_vector(unknowns), np.zeros(0), np.zeros((0, len(unknowns))), 0.0)
    assert is_at_bound(solution, name, 1e-6) is expected


@pytest.mark.parametrize("late", ["by_chance", "rounded"])
def test_the_frequency_of_a_hum_is_read_off_the_stamps_and_not_off_their_number(late):
    """The median interval is no clock: 50 Hz were 53.5 in an event log, 44.6 with stamps rounded to 2 ms."""
    intervals = (0.7 + np.random.default_rng(1).exponential(0.3, 4000)) / 400.0
    t = np.cumsum(intervals) if late == "by_chance" else np.round(np.arange(4000) / 280.0 / 2e-3) * 2e-3
    rig = load_rig("paper_high_impedance")
    hum = EffectSetting("mains_interference", {"amplitude": 0.3, "frequency": 50.0, "phase": 1.0})
    command = Channel(t, np.random.default_rng(2).normal(0.0, 3.0, 4000))
    record = synthesize(rig.with_effects(hum), command, seed=3)
    case = case_from(record, rig)
    (outputs,) = Problem((case,), rig, (), MEASURED).outputs(np.zeros(0))
    guess, *_ = initial_guesses(effect_named("mains_interference"), RecordView(case, rig, outputs))
    assert guess["frequency"] == pytest.approx(50.0, abs=0.1)
    assert guess["amplitude"] == pytest.approx(0.3, rel=0.1)
