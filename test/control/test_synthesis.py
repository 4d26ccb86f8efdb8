"""Gains by synthesis: what was demanded is kept, and no neighbour within the margins leaves less friction."""

from dataclasses import replace

import pytest

from rsea_ros.control.loads import LOCKED, load_range
from rsea_ros.control.synthesis import check, design
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig

RATE = 280.0
RIG, FREE = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
LOADS = load_range(RIG, FREE)


@pytest.fixture(scope="module")
def found():
    """The design for the paper's actuator at 280 Hz."""
    return design(RIG, LOADS, RATE)


def test_every_margin_of_the_issue_is_kept_at_280_hz(found):
    assert found.margins[LOCKED].crossover > 3.0 * 6.365
    assert found.margins[LOCKED].phase >= 44.9
    for margin in found.margins.values():
        assert margin.phase >= 34.9 and margin.gain >= 5.95 and margin.delay >= 0.99


def test_no_neighbour_that_keeps_the_margins_leaves_less_friction(found):
    for name in ("k_p", "k_d", "q_frequency"):
        for factor in (0.93, 1.07):
            gains = replace(found.gains, **{name: factor * getattr(found.gains, name)})
            other = check(RIG, LOADS, RATE, gains)
            short = other.margins[LOCKED].phase < 44.9 or any(
                m.phase < 34.9 or m.gain < 5.95 for m in other.margins.values()
            )
            assert short or other.friction_left > 0.98 * found.friction_left


def test_a_bench_that_lags_gets_gentler_gains(found):
    slow = RIG.with_effects(EffectSetting("current_loop_lag", {"time_constant": 3e-3}))
    gentle = design(slow, load_range(slow, FREE), RATE)
    assert gentle.margins[LOCKED].phase >= 44.9
    assert gentle.friction_left > 1.3 * found.friction_left


def test_loads_reach_from_locked_to_free():
    assert list(LOADS)[:2] == [LOCKED, "free x 1"]
    assert LOADS["free x 10"]["housing_end.inertia"] == pytest.approx(1.01)
    assert all(load["rotor.reflected_inertia"] == RIG["rotor.reflected_inertia"] for load in LOADS.values())
    with pytest.raises(ParameterError, match="both ends are clamped"):
        load_range(RIG, RIG)


@pytest.mark.parametrize(("name", "message"), [("bare_drive", "spring.rigid"), ("pendulum", "spring.rigid")])
def test_a_rig_without_a_torque_to_feel_is_refused(name, message):
    rig = load_rig(name)
    with pytest.raises(ParameterError, match=message):
        design(rig, load_range(rig), RATE)
