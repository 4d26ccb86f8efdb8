"""The sign of every gear train, from its rolling contacts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rolling import rotor_speed

from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import end_to_end, flat_band, inner_inertia, resonance_peak, undamped_band
from rsea_ros.model.equations import mechanics, rotor_inertia, train_ratio
from rsea_ros.model.rig import END_NAMES
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.train import TRAINS, rotor_turns, spin_inertia
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.rival_models import lumped_rig

MOVING, KNEE = load_rig("paper_moving_output"), load_rig("prototype_knee")


def with_train(rig, train):
    """The rig with another train."""
    return replace(rig, train=train)


@pytest.mark.parametrize("train", TRAINS)
@pytest.mark.parametrize("ratio", [2.0, 5.5, 160.0, 502.0])
def test_turns_follow_from_the_rolling_contacts(train, ratio):
    assert rotor_turns(train, ratio) == pytest.approx(rotor_speed(train, ratio, 0.0, 1.0), rel=1e-12)
    carried = 1.0 if train != "lumped" else ratio
    assert rotor_speed(train, ratio, 1.0, 1.0) == pytest.approx(carried), "locked, all turn as one"


@pytest.mark.parametrize("train", TRAINS)
def test_mass_matrix_is_the_energy_of_the_rolling_parts(train):
    """Kinetic energy at three pairs of speeds, the rotor's from its contacts, fixes all of M."""
    rig = with_train(MOVING, train)
    j_r, j_h = rotor_inertia(rig), rig["housing_end.inertia"] + rig["housing.inertia"]
    for speeds in ((1.0, 0.0), (0.0, 1.0), (1.0, -2.0)):
        rotor = rotor_speed(train, 502.0, *speeds)
        twice = j_r * rotor**2 + j_h * speeds[0] ** 2 + rig["chassis.inertia"] * speeds[1] ** 2
        w = np.array(speeds)
        assert w @ mechanics(rig).mass @ w == pytest.approx(twice, rel=1e-9)


def test_a_harmonic_drive_never_has_the_makers_ratio_with_a_positive_sign():
    """CPL-25A-160: -160 with the circular spline held, +161 with the flexspline held, never +160."""
    turns = [rotor_turns(t, 160.0) for t in TRAINS if t.startswith("harmonic")]
    assert turns == [-160.0, 161.0]
    assert KNEE.train == "harmonic_circular_spline_held"
    assert train_ratio(KNEE) == -160.0


@pytest.mark.parametrize(
    ("train", "inner", "hz", "stiffness"),
    [
        ("harmonic_circular_spline_held", -0.00688, 19.9, 1647.0),
        ("harmonic_flexspline_held", 0.00816, 15.35, 2759.0),
    ],
)
def test_the_prototype_has_its_reference_numbers(train, inner, hz, stiffness):
    """Found by independent checks; J_m = 1.2 is an estimate."""
    rig = with_train(KNEE, train)
    assert inner_inertia(rig) == pytest.approx(inner, abs=5e-6)
    assert flat_band(end_to_end(rig)) == pytest.approx(hz, abs=0.05)
    assert float(undamped_band(260.0, inner_inertia(rig))) == pytest.approx(hz, abs=0.05)
    assert float(undamped_band(stiffness, inner_inertia(rig))) == pytest.approx(50.0, abs=0.01)
    peak_hz, peak_db = resonance_peak(end_to_end(rig))
    if inner < 0.0:
        assert (peak_hz, peak_db) == (0.0, 0.0), "rolls off without a resonance"
    else:
        assert peak_hz == pytest.approx(28.4, abs=0.1)
        assert peak_db > 20.0


@pytest.mark.parametrize("train", TRAINS)
def test_the_two_ends_differ_by_the_inner_inertia(train):
    """(T_p - T_d) / q_c'' over a band, from the two responses; the spring's damping cancels."""
    rig = replace(KNEE, train=train, clamped=frozenset(END_NAMES))
    hz = np.array([1.0, 10.0, 80.0])
    near, far, q = (
        frequency_response(rig, y, hz)
        for y in (
            outputs.end_torque(rig, "housing_end"),
            outputs.end_torque(rig, "spring_end"),
            outputs.position(),
        )
    )
    acceleration = -((2.0 * np.pi * hz) ** 2) * q
    np.testing.assert_allclose((near - far) / acceleration, inner_inertia(rig), rtol=1e-6)


def test_without_inner_inertia_the_band_has_no_edge():
    assert float(undamped_band(260.0, 0.0)) == np.inf


def test_a_lumped_rotor_counts_whole_at_the_chassis():
    assert spin_inertia("lumped", 160.0, 1.2) == 1.2
    assert inner_inertia(lumped_rig(KNEE)) == pytest.approx(1.2 + 6.169e-4)
