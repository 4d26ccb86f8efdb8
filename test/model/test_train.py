"""The sign of every gear train, from its rolling contacts."""

from dataclasses import replace

import numpy as np
import pytest
from rolling import rotor_speed

from rsea_ros.errors import RigError
from rsea_ros.model import outputs
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig import END_NAMES, Quantity
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import load_rig, rig_to_document
from rsea_ros.model.train import TRAINS, rotor_turns, spin_inertia
from rsea_ros.model.transfer import frequency_response, inner_inertia, undamped_band
from rsea_ros.paper.rival_models import lumped_rig

MOVING, KNEE = load_rig("paper_moving_output"), load_rig("prototype_knee")


@pytest.mark.parametrize("train", TRAINS)
@pytest.mark.parametrize("ratio", [2.0, 5.5, 160.0, 502.0])
def test_turns_follow_from_the_rolling_contacts(train, ratio):
    assert rotor_turns(train, ratio) == pytest.approx(rotor_speed(train, ratio, 0.0, 1.0), rel=1e-12)
    carried = 1.0 if train != "lumped" else ratio
    assert rotor_speed(train, ratio, 1.0, 1.0) == pytest.approx(carried), "locked, all turn as one"


@pytest.mark.parametrize("train", [t for t in TRAINS if t != "lumped"])
def test_held_by_the_gear_the_rotor_turns_against_the_output(train):
    """The same rolling contacts with the output at rest, per turn of the housing."""
    turns = rotor_turns(train, 160.0, "housing")
    assert turns == pytest.approx(rotor_speed(train, 160.0, 1.0, 0.0), rel=1e-12)
    rig = replace(KNEE, train=train, beside_spring="housing")
    assert train_ratio(rig_from_document(rig_to_document(rig))) == turns


def test_the_inertia_beside_the_spring_has_one_place():
    quantities = {**KNEE.quantities, "housing.inertia": Quantity(0.3)}
    with pytest.raises(RigError, match=r"expected it as chassis\.inertia"):
        replace(KNEE, beside_spring="housing", quantities=quantities)


@pytest.mark.parametrize(("housing", "hz"), [(0.004, 73.3), (0.0012, 152.0)])
def test_the_platform_held_by_its_gear_has_another_band(housing, hz):
    rig = replace(load_rig("paper_high_impedance"), beside_spring="housing")
    rig = rig.with_values({"chassis.inertia": housing})
    assert inner_inertia(rig) == pytest.approx(housing + (1 - 502) * 0.953 / 502**2, rel=1e-3)
    assert float(undamped_band(rig["spring.stiffness"], inner_inertia(rig))) == pytest.approx(hz, rel=0.01)


@pytest.mark.parametrize("train", TRAINS)
def test_the_two_ends_differ_by_the_inner_inertia(train):
    """(T_p - T_d) / q_c'' over a band, from the two responses; the spring's damping cancels."""
    rig = replace(KNEE, train=train, clamped=frozenset(END_NAMES))
    hz = np.array([1.0, 10.0, 80.0])
    torques = (outputs.end_torque(rig, end) for end in END_NAMES)
    near, far, q = (frequency_response(rig, y, hz) for y in (*torques, outputs.position()))
    acceleration = -((2.0 * np.pi * hz) ** 2) * q
    np.testing.assert_allclose((near - far) / acceleration, inner_inertia(rig), rtol=1e-6)


def test_a_lumped_rotor_counts_whole_at_the_chassis():
    assert spin_inertia("lumped", 160.0, 1.2) == 1.2
    assert inner_inertia(lumped_rig(KNEE)) == pytest.approx(1.2 + 6.169e-4)
