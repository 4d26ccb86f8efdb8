"""The paper's numbers beside ours: agreements, disagreements, and every contradiction with its number."""

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.design.motor_gear_units import unit_named
from rsea_ros.model import outputs
from rsea_ros.model.rig import END_NAMES
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.train import TRAINS
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.bands import HZ, arrangements, limits
from rsea_ros.paper.findings import clamp_error, findings
from rsea_ros.paper.formulas import PROTOTYPE_TRAINS, claims, last_digit
from rsea_ros.paper.rival_models import draw, largest_gap, readings, resonance_hz


@pytest.mark.parametrize(("text", "step"), [("3.14", 0.01), ("7", 1.0), ("6.169e-4", 1e-7), ("1e8", 1e8)])
def test_a_number_agrees_to_its_last_printed_digit(text, step):
    assert last_digit(text) == pytest.approx(step)


def test_only_results_of_the_papers_own_numbers_count():
    """No conversions of inches, no number that is not printed, nothing tuned, nothing from other sources."""
    counted = {c.what: c.agrees for c in claims() if c.status == "found"}
    assert counted == {
        "K_s/J_eff, numerator": False,
        "J_m": True,
        "b_m": True,
        "factor": True,
        "bandwidth of the prototype": False,
    }
    assert {c.what for c in claims() if c.status == "silent"} == {"K_s, nominal", "K_s, prototype"}
    printed = {c.printed for c in claims()}
    assert not printed & {"1.000", "0.957", "26.088", "127", "114", "50.8"}


def test_the_numbers_that_disagree_are_listed():
    off = {c.what: round(100 * c.difference, 1) for c in claims() if not c.agrees}
    assert off["K_s/J_eff, numerator"] == 5.0
    assert off["bandwidth of the prototype"] == 0.6
    assert off["K_ld, pendulum"] == -7.4
    assert off["b_m, viscous"] == -85.9


def test_contradictions_are_those_that_hold():
    """Numbers that the paper admits, of the test platform, or that rest on our J_m are no contradictions."""
    assert sum(f.status == "found" for f in findings()) == 7


def test_both_readings_of_the_lumped_model_miss_the_resonance():
    """Asked: 6.1 Hz against 19.8 Hz; the grounded motor is 62.0 dB off at the pendulum's frequency."""
    unlumped, moving, grounded = readings(load_rig("paper_moving_output")).values()
    assert resonance_hz(unlumped) == pytest.approx(19.8, abs=0.05)
    assert resonance_hz(moving) == pytest.approx(6.1, abs=0.05)
    assert largest_gap(unlumped, grounded) == pytest.approx((1.34, 62.0), abs=0.05)
    fine = np.linspace(1.30, 1.38, 2001)
    ours, theirs = (
        frequency_response(rig, outputs.end_torque(rig, "spring_end"), fine) for rig in (unlumped, grounded)
    )
    assert np.max(20.0 * np.log10(np.abs(theirs / ours))) == pytest.approx(
        largest_gap(unlumped, grounded)[1], abs=1e-3
    )


def test_the_catalogue_and_the_paper_leave_the_same_trains_open():
    assert unit_named("rd85x13-hd_cpl-25a-160").trains == PROTOTYPE_TRAINS
    knee = load_rig("prototype_knee")
    assert (knee.train, *knee.other_trains) == PROTOTYPE_TRAINS


def test_the_papers_1e8_is_as_good_as_a_clamp():
    assert clamp_error() < 1e-6


@pytest.mark.parametrize("proximal", END_NAMES)
@pytest.mark.parametrize("index", range(2 * len(TRAINS)))
def test_the_table_has_the_right_transfer_functions(index, proximal):
    rig = load_rig("paper_high_impedance")
    row = arrangements(rig)[index]
    rig = replace(rig, train=row.train, beside_spring=row.beside_spring, proximal=proximal)
    s = 2j * np.pi * HZ
    den = row.outer * s**2 + (23.088 + 3.0) * s + 1530.456
    expected = [(3.0 * s + 1530.456) / den, (row.inner * s**2 + 3.0 * s + 1530.456) / den]
    torques = [outputs.distal(rig), outputs.proximal(rig)]
    for torque, value in zip(torques, expected if proximal == "housing_end" else expected[::-1], strict=True):
        np.testing.assert_allclose(frequency_response(rig, torque, HZ), value, rtol=1e-9)


def test_every_limit_is_reached():
    for limit in limits(load_rig("paper_moving_output")):
        if len(limit.values) == 1:
            assert limit.errors[0] < 1e-12, limit.what
            continue
        assert limit.errors[-1] < 3e-3, limit.what
        order = np.log10(limit.errors[-2] / limit.errors[-1]) / np.log10(limit.values[-1] / limit.values[-2])
        assert order == pytest.approx(1.0, abs=0.15), limit.what


def test_the_bench_differs_from_what_the_rig_states():
    rig = load_rig("paper_moving_output")
    bench = draw(rig, 1)
    assert all(bench[n] != rig[n] for n in rig.free())
    assert all(bench[n] == rig[n] for n in rig.known)
