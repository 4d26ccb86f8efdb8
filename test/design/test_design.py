"""The design method: the paper's example, and results that the paper leaves out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.design import mechanism
from rsea_ros.design.mechanism import Requirement
from rsea_ros.design.motor_gear_units import catalogue, unit_named
from rsea_ros.design.spring_design import (
    band_range,
    by_train,
    least_stiffness,
    margins,
    robust_stiffness,
    spreads_of,
    spring_design,
    stiffness_bounds,
)
from rsea_ros.errors import ParameterError
from rsea_ros.model import outputs
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response, undamped_band
from rsea_ros.paper.bands import bands
from rsea_ros.paper.formulas import eq_8_spring_torque, eq_9_spring_stiffness

PAPER = Requirement()
UNIT = unit_named("rd85x13-hd_cpl-25a-160")
ASKED = spring_design(PAPER, UNIT, 260.0)


TRAIN = "train: {value: star, source: x}"
VALUES = "ratio: {}, continuous_torque: {}, reflected_inertia: {}, reflected_damping: {}"


def checks_met(design):
    return [check.met for check in design.checks]


def test_the_papers_example_is_reproduced():
    """150 N m, above 50 Hz, 6.169e-4 kg m^2: 260 N m/rad reach 55.8 Hz by Eq. (7)."""
    assert ASKED.band_eq_7 == pytest.approx(55.83, abs=5e-3)
    assert ASKED.checks[0].met
    assert 260.0 > stiffness_bounds(PAPER, UNIT)["Bandwidth by Eq. (7)"] == pytest.approx(208.5, abs=0.05)
    assert ASKED.rate == pytest.approx(185185.0, rel=1e-3)


def test_the_example_also_yields_what_the_paper_leaves_out():
    assert float(mechanism.largest_torque(260.0)) == 130.0 < PAPER.torque
    assert math.isnan(ASKED.deflection)
    assert ASKED.linear == pytest.approx(0.577, abs=5e-4)
    assert math.degrees(ASKED.linear) == pytest.approx(33.0, abs=0.1)
    assert ASKED.band_exact == pytest.approx(19.87, abs=5e-3)
    assert math.isnan(ASKED.resonance)
    assert checks_met(ASKED) == [True, False, False, False, True]


def test_the_least_stiffness_meets_all_and_a_little_less_does_not():
    k_s = least_stiffness(PAPER, UNIT)
    assert spring_design(PAPER, UNIT, k_s).feasible
    assert not spring_design(PAPER, UNIT, 0.999 * k_s).feasible
    soft = replace(PAPER, bandwidth=5.0)
    least = spring_design(soft, UNIT, least_stiffness(soft, UNIT))
    assert least.feasible
    assert math.degrees(least.deflection) == pytest.approx(5.0)


@pytest.mark.parametrize("degrees", [0.5, 5.0, 30.0, 45.0])
def test_deflection_inverts_eq_8(degrees):
    theta = math.radians(degrees)
    torque = eq_8_spring_torque(185185.0, 0.0254, 0.0131, theta)
    k_s = eq_9_spring_stiffness(185185.0, 0.0254, 0.0131)
    assert float(mechanism.deflection(k_s, torque)) == pytest.approx(theta, rel=1e-6)
    assert 1.0 - torque / (k_s * theta) == pytest.approx(float(mechanism.linearity_error(theta)))


def test_monte_carlo_agrees_with_the_closed_form_spread():
    """Eq. (7) goes as sqrt(K / J): log-normal spreads in closed form, arm and spring radius exact."""
    spreads = {**dict.fromkeys(spreads_of(UNIT), 0.0), "rate": 0.06, "inertia": 0.08}
    row = margins(ASKED, spreads)[0]
    sigma = 0.5 * math.hypot(0.06, 0.08)
    expected = [ASKED.band_eq_7 * math.exp(1.6449 * s * sigma) for s in (-1, 0, 1)]
    assert row.percentiles == pytest.approx(expected, rel=0.004)


def test_without_spread_a_margin_is_all_or_nothing():
    shares = [m.share for m in margins(ASKED, dict.fromkeys(spreads_of(UNIT), 0.0))]
    assert shares == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]


def test_robust_is_stiffer_and_impossible_where_the_motor_is_too_weak():
    k_s = robust_stiffness(PAPER, UNIT)
    assert k_s > least_stiffness(PAPER, UNIT)
    assert margins(spring_design(PAPER, UNIT, k_s))[-1].share == pytest.approx(0.95, abs=3e-3)
    assert robust_stiffness(PAPER, unit_named("h54-200-s500-r")) == math.inf


def test_the_amplitude_of_a_band_is_limited_by_motor_and_travel():
    """The motor's limit over T_d/T_m of the clamped rig; 5 degrees of a spring by Eq. (8)."""
    rig = load_rig("paper_high_impedance")
    widths = bands(rig, 44.2)
    gain = abs(frequency_response(rig, outputs.distal(rig), np.array([10.0]))[0])
    assert widths.motor_limit[10.0] == pytest.approx(44.2 * gain)
    assert widths.spring_limit == pytest.approx(1530.456 / 2 * math.sin(math.radians(10.0)))
    assert widths.eq_7 == pytest.approx(53.20, abs=5e-3)
    assert [*widths.rows.values()][1][0] == pytest.approx(112.1, abs=0.05)


def test_both_arrangements_of_the_prototypes_drive_are_designed():
    """50 Hz need 1647 N m/rad with the circular spline held, 2759 with the flexspline; all 1728."""
    held = {row.design.unit.train: row for row in by_train(PAPER, UNIT, 260.0)}
    circular, flexspline = held.values()
    assert list(held) == ["harmonic_circular_spline_held", "harmonic_flexspline_held"]
    assert (circular.design.unit.turns, flexspline.design.unit.turns) == (-160.0, 161.0)
    bands = [row.design.band_exact for row in held.values()]
    assert bands == pytest.approx([19.87, 15.35], abs=0.01)
    assert [circular.for_band, flexspline.for_band] == pytest.approx([1647.0, 2759.0], abs=1.0)
    assert [circular.least, flexspline.least] == pytest.approx([1728.0, 2759.0], abs=1.0)


@pytest.mark.parametrize(
    ("train", "sign"), [(t, -1) for t in UNIT.trains[:1]] + [(t, 1) for t in UNIT.trains[1:]]
)
def test_a_heavier_chassis_helps_where_the_rotor_turns_backward(train, sign):
    unit, heavier = UNIT.with_train(train), replace(PAPER, inertia=2.0 * PAPER.inertia)
    change = spring_design(heavier, unit, 260.0).band_exact - spring_design(PAPER, unit, 260.0).band_exact
    assert sign * change < -0.4


def test_the_band_is_given_over_the_range_of_the_rotors_inertia():
    """Ends of the log-normal range, and no upper end where the spin cancels the chassis within it."""
    low, high = band_range(260.0, 6.169e-4, UNIT.spin, 0.5)
    for hz, factor in ((low, math.exp(1.6449 * 0.5)), (high, math.exp(-1.6449 * 0.5))):
        assert hz == pytest.approx(float(undamped_band(260.0, 6.169e-4 + factor * UNIT.spin)))
    assert band_range(260.0, 6.169e-4, -6.0e-4, 0.5)[1] == math.inf


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"a: {{{TRAIN}, ratio: {{value: 5, unit: N m, source: x}}}}", r"a.continuous_torque is missing"),
        ("a: 3", r"a = 3, expected a mapping"),
        ("[", "not YAML"),
        (f"a: {{train: {{value: worm, source: x}}, {VALUES}}}", r"a.train.value = 'worm', expected one of"),
        (f"a: {{{VALUES}}}", r"a.train is missing, expected one of planetary, star"),
    ],
)  # fmt: skip
def test_bad_catalogues_are_refused(tmp_path, text, message):
    path = tmp_path / "units.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=f"units.yaml: .*{message}"):
        catalogue(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"torque": -1.0}, r"torque = -1 N·m, expected 1e-09 to 1e"),
        ({"bandwidth": math.nan}, r"bandwidth = nan Hz"),
        ({"deflection": 1.0}, r"deflection = 57.2958 deg, expected at most 45 deg"),
        ({"separation": 0.2}, r"separation = 0.2 m, expected within the diameter of 0.12 m"),
    ],
)
def test_impossible_requirements_are_refused(change, message):
    with pytest.raises(ParameterError, match=message):
        replace(PAPER, **change)


@pytest.mark.parametrize(
    ("change", "demand"),
    [({"torque": 9e5}, "Deflection"), ({"inertia": 1e5}, "Eq. \\(7\\)"), ({"bandwidth": 9e5}, "spin")],
)
def test_a_demand_that_no_spring_meets_is_named_and_not_the_stiffness(change, demand):
    with pytest.raises(ParameterError, match=f"demand .*{demand}. asks for a spring of"):
        least_stiffness(replace(PAPER, **change), UNIT)
