"""A gear that gives, beside a rig that states no inertia for its spring chassis."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig


def test_a_chassis_without_a_stated_inertia_takes_a_part_of_the_rotors():
    rig = load_rig("sea_two_encoders")
    soft = effect_named("gear_compliance").structure(rig, {"stiffness": 1e4})
    assert np.linalg.eigvalsh(mechanics(soft).mass).min() > 0.0
    assert soft["rotor.reflected_inertia"] + soft["chassis.inertia"] == pytest.approx(
        rig["rotor.reflected_inertia"]
    )


def test_a_stated_chassis_keeps_its_inertia():
    rig = load_rig("paper_high_impedance")
    soft = effect_named("gear_compliance").structure(rig, {"stiffness": 1e4})
    assert soft["chassis.inertia"] == rig["chassis.inertia"]
    assert soft["rotor.reflected_inertia"] == rig["rotor.reflected_inertia"]
