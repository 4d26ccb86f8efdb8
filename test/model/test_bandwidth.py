"""The band of a pure torque source: exact edges against a dense search, and what the rotor's spin costs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.model import transfer
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.formulas import eq_6_distal_per_proximal

PLATFORM, PROTOTYPE = load_rig("paper_high_impedance"), load_rig("prototype_knee")
HZ = np.arange(0.001, 400.0, 0.001)


@pytest.mark.parametrize("rig", [PLATFORM, PROTOTYPE], ids=lambda rig: rig.name)
@pytest.mark.parametrize(
    ("sees", "db", "deg"),
    [("element", 3.0, 90.0), ("spring_and_damper", 3.0, 10.0), ("spring_and_damper", 0.2, 89.0)],
)
def test_band_is_where_a_dense_search_first_leaves_it(rig, sees, db, deg):
    function = transfer.end_to_end(rig, sees)
    values = function(2j * np.pi * HZ)
    off = np.abs(20 * np.log10(np.abs(values))) > db
    if deg < 90.0:
        off |= np.abs(np.degrees(np.angle(values))) > deg
    assert transfer.flat_band(function, db, deg) == pytest.approx(HZ[np.argmax(off)], abs=0.0011)


def test_undamped_band_at_sqrt_2_is_eq_7_with_the_exact_factor():
    undamped = eq_6_distal_per_proximal(1530.456, 0.004, 0.0)
    assert transfer.flat_band(undamped, 20 * math.log10(math.sqrt(2))) == pytest.approx(
        transfer.pure_torque_bandwidth(1530.456, 0.004, 1.0 - math.sqrt(0.5))
    )


@pytest.mark.parametrize(("db", "deg"), [(0.0, 10.0), (3.0, 0.0), (3.0, 91.0), (math.nan, 10.0)])
def test_impossible_tolerances_are_refused(db, deg):
    with pytest.raises(ParameterError, match="tolerances"):
        transfer.flat_band(transfer.end_to_end(PLATFORM), db, deg)


def test_peak_is_the_highest_point():
    for case in ((PLATFORM,), (PLATFORM, "element"), (PROTOTYPE,)):
        function = transfer.end_to_end(*case)
        gains = 20 * np.log10(np.abs(function(2j * np.pi * HZ)))
        hz, db = transfer.resonance_peak(function)
        assert hz == pytest.approx(HZ[np.argmax(gains)], abs=0.001)
        assert db == pytest.approx(gains.max(), abs=1e-3)


def test_a_falling_response_has_its_peak_at_rest():
    assert transfer.resonance_peak(eq_6_distal_per_proximal(100.0, 0.01, 50.0)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("rig", "inertia", "with_spin"),
    [(PLATFORM, 5.898e-3, 43.81), (PROTOTYPE, -6.883e-3, 19.87)], ids=["platform", "prototype"],
)  # fmt: skip
def test_the_rotors_spin_narrows_the_band_as_the_docs_say(rig, inertia, with_spin):
    """The numbers of docs/physics.md: Eq. (7) with J_sc + n J_r."""
    assert transfer.inner_inertia(rig) == pytest.approx(inertia, rel=1e-4)
    band = float(transfer.undamped_band(rig["spring.stiffness"], transfer.inner_inertia(rig)))
    assert band == pytest.approx(with_spin, abs=5e-3)


def test_end_to_end_does_not_depend_on_the_motor_or_the_ends():
    changed = replace(load_rig("paper_moving_output"), proximal="housing_end")
    changed = changed.with_values({"rotor.reflected_damping": 1.0})
    s = 2j * np.pi * HZ[::5000]
    np.testing.assert_allclose(transfer.end_to_end(changed)(s), transfer.end_to_end(PLATFORM)(s), rtol=1e-9)
