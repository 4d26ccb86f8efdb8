"""The equation of every effect, against a second implementation of it that a general solver integrates."""

from __future__ import annotations

import numpy as np
import pytest
import slow_equations
from effect_bench import ON_THE_BENCH, RIG, SIGNALS, command, record_of, rms, simulate

from rsea_ros.effects.effect import Effect
from rsea_ros.model.drive import drive_from

TOLERANCE = {"ft": 6e-3, "position": 1.5e-6, "velocity": 8e-5}
"""A fifth to two fifths of the sensors' noise."""


def test_every_effect_has_an_independent_equation():
    assert set(slow_equations.LAWS) == {e.name for e in ON_THE_BENCH}


def test_both_implementations_agree_without_effects():
    ours = (RIG["rotor.reflected_inertia"], RIG["chassis.inertia"], RIG["rotor.reflected_damping"],
            RIG["spring.stiffness"], RIG["spring.damping"], RIG["gear.ratio"])  # fmt: skip
    theirs = (slow_equations.J_M, slow_equations.J_SC, slow_equations.B_M,
              slow_equations.K_S, slow_equations.B_S, slow_equations.RATIO)  # fmt: skip
    assert ours == theirs


@pytest.mark.parametrize("effect", ON_THE_BENCH, ids=lambda e: e.name)
def test_the_simulation_obeys_the_equation_of_every_effect(effect: Effect):
    commanded = command(rate=280.0, duration=slow_equations.DURATION)
    simulated = simulate(drive_from(record_of(commanded)), effect.name, effect.typical)
    nominal = simulate(drive_from(record_of(commanded)))
    true = slow_equations.solve(effect.name, effect.typical, commanded.y, commanded.t[1])
    changed = [n for n in SIGNALS if not np.array_equal(simulated[n], nominal[n])]
    assert changed
    for name in SIGNALS:
        error = rms(simulated[name] - true[name])
        assert error < TOLERANCE[name], (name, error)
        if name in changed:
            assert error < 0.005 * rms(true[name] - nominal[name]), (name, error)
