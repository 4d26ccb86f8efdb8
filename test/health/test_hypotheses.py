"""What of a joint may have changed, by how much that is an alarm, and what the change makes of its rig."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rsea_ros.health.hypotheses import hypotheses_of, nuisances_of
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
PERIOD = 0.004
ROWS = {
    "rotor.reflected_damping": ("RSEA_FRICTION", 23.088, 0.1 * 23.088, 0.25 * 23.088, 0.25 * 23.088),
    "coulomb_friction.torque": ("RSEA_FRICTION", 0.0, 0.0, 0.5, 0.5),
    "friction.factor": ("RSEA_FRICTION", 1.0, 0.1, 0.2, 0.2),
    "command_delay.delay": ("RSEA_DELAY", 0.0, 0.0, 0.002, 0.004),
    "torque_constant_error.gain": ("RSEA_TORQUE_CONSTANT", 1.0, 0.01, 0.05, 0.05),
    "spring.stiffness": ("RSEA_STIFFNESS", 1530.456, 0.025 * 1530.456, 0.05 * 1530.456, 0.05 * 1530.456),
    "backlash.gap": ("RSEA_BACKLASH", 0.0, 0.0, 1e-3, 2e-3),
    "ft_gain_error.gain": ("RSEA_FT_GAIN", 1.0, 0.01, 0.03, 0.05),
    "ft_bias.bias": ("RSEA_FT_BIAS", 0.0, 0.0, 0.3, 0.3),
    "rotor.reflected_inertia": ("", 0.953, 0.075 * 0.953, 0.0953, 0.0953),
    "spring.damping": ("", 3.0, 0.75, 0.3, 0.3),
}
"""Of the paper's machine: code, value, doubt (half its spread), least alarm beyond it, step."""
SPRUNG = {"spring.stiffness", "backlash.gap", "ft_gain_error.gain", "ft_bias.bias", "spring.damping"}


def every(rig):
    return {h.name: h for h in (*hypotheses_of(rig, PERIOD), *nuisances_of(rig))}


def test_each_change_has_its_doubt_and_its_least_alarm() -> None:
    found = every(RIG)
    rows = {h.name: (h.code, h.value, h.doubt, h.least, h.step) for h in found.values()}
    assert {name: row[0] for name, row in rows.items()} == {name: row[0] for name, row in ROWS.items()}
    for name, (_, *numbers) in ROWS.items():
        h = found[name]
        assert rows[name][1:] == pytest.approx(tuple(numbers)), name
        assert h.grain == (PERIOD if name == "command_delay.delay" else 0.0)
        assert h.inner == pytest.approx(1.959964 * h.doubt) and h.outer == pytest.approx(h.inner + h.least)
        if name.startswith(("rotor", "spring")):
            assert (h.low, h.high) == pytest.approx((0.02 * h.value, 50.0 * h.value))
    assert (found["friction.factor"].low, found["friction.factor"].high) == (0.05, 20.0)
    assert set(every(load_rig("bare_drive"))) == set(ROWS) - SPRUNG


def test_a_change_acts_on_the_rig_within_its_bounds() -> None:
    found = every(RIG)
    stiffer = found["spring.stiffness"].change(RIG, 100.0)
    assert stiffer["spring.stiffness"] == pytest.approx(1630.456)
    assert found["spring.stiffness"].change(RIG, -2e3)["spring.stiffness"] == pytest.approx(0.02 * 1530.456)
    assert found["spring.stiffness"].within(-2e3) == pytest.approx(-0.98 * 1530.456)
    assert found["spring.stiffness"].within(1e9) == pytest.approx(49.0 * 1530.456)
    (late,) = found["command_delay.delay"].change(RIG, 0.01).effects
    assert (late.name, late.parameters) == ("command_delay", {"delay": 0.01})


def test_a_worn_gear_has_more_of_both_frictions() -> None:
    rig = RIG.with_effects(EffectSetting("coulomb_friction", {"torque": 4.0}))
    found = every(rig)
    worn = found["friction.factor"].change(rig, 0.5)
    assert worn["rotor.reflected_damping"] == pytest.approx(1.5 * 23.088)
    assert worn.effects[0].parameters["torque"] == pytest.approx(6.0)
    assert found["coulomb_friction.torque"].least == 1.0 and found["coulomb_friction.torque"].doubt == 0.4
    assert found["coulomb_friction.torque"].change(rig, 1.0).effects[0].parameters["torque"] == 5.0


def test_a_fitted_value_is_as_doubtful_as_its_interval() -> None:
    inertia = replace(RIG.quantities["rotor.reflected_inertia"], ci95=(0.9, 1.0))
    rig = replace(RIG, quantities={**RIG.quantities, "rotor.reflected_inertia": inertia})
    assert every(rig)["rotor.reflected_inertia"].doubt == pytest.approx(0.1 / (2.0 * 1.959964))
    known = replace(RIG, known=RIG.known | {"rotor.reflected_inertia"})
    assert every(known)["rotor.reflected_inertia"].doubt == 0.0
