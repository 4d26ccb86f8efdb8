"""Limits that nobody states are the smallest that rig, motor and sensor give; a stated one has a bound."""

import math

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import EffectSetting, motor_torque
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import check_travel, derive, felt_through_spring

RIG = load_rig("paper_high_impedance")
K, B = 1530.456, 23.088
"""N m/rad, N m s/rad: of spring and gear."""
MOTOR = motor_torque(RIG)[0]
NAMES = ("deflection", "torque", "velocity", "ft")
FIVE = math.radians(5.0)


SOURCES = {
    "deflection": [(0.03, "hard_stop of the rig"), (FIVE, "5°, where")],
    "torque": [(0.03 * K, "deflection_limit"), (MOTOR, motor_torque(RIG)[1]), (20.0, "the motor's")],
    "velocity": [(5.0, "where gear and motor"), (1.0, "the motor's speed"), (0.8 * MOTOR / B, "0.8 of")],
    "ft": [(110.0, "where the sensor states no"), (60.0, "the F/T sensor's range")],
}


def stopped(angle):
    return RIG.with_effects(EffectSetting("hard_stop", {"angle": angle, "stiffness": 1e4, "damping": 1.0}))


@pytest.mark.parametrize(
    ("stated", "rig", "rating", "limits", "derived"),
    [
        ({}, RIG, {}, (FIVE, MOTOR, 0.8 * MOTOR / B, 110.0), NAMES),
        ({}, stopped(0.03), {}, (0.03, 0.03 * K, 0.8 * 0.03 * K / B, 110.0), NAMES),
        ({}, stopped(0.3), {}, (FIVE, MOTOR, 0.8 * MOTOR / B, 110.0), NAMES),
        ({}, RIG, {"torque": 20.0, "ft": 60.0}, (FIVE, 20.0, 0.8 * 20.0 / B, 60.0), NAMES),
        ({}, RIG, {"velocity": 1.0, "ft": 111.0}, (FIVE, MOTOR, 1.0, 110.0), NAMES),
        ({}, RIG.with_values({"rotor.reflected_damping": 0.0}), {}, (FIVE, MOTOR, 5.0, 110.0), NAMES),
        ({}, RIG.with_values({"rotor.reflected_damping": 1.0}), {}, (FIVE, MOTOR, 5.0, 110.0), NAMES),
        ({"torque": 10.0}, RIG, {}, (FIVE, 10.0, 0.8 * MOTOR / B, 110.0), ("deflection", "velocity", "ft")),
        ({"deflection": 0.01}, RIG, {}, (0.01, 0.01 * K, 0.8 * 0.01 * K / B, 110.0), NAMES[1:]),
        ({"velocity": 1.5, "ft": 7.0}, RIG, {}, (FIVE, MOTOR, 1.5, 7.0), NAMES[:2]),
    ],
)
def test_a_limit_is_the_smallest_that_anything_gives(stated, rig, rating, limits, derived):
    found, sources = derive(stated, rig, rating)
    assert tuple(found[name] for name in NAMES) == pytest.approx(limits) and set(sources) == set(derived)
    for name in derived:
        whose = [source for value, source in SOURCES[name] if math.isclose(value, found[name])]
        assert [source for source in whose if sources[name].startswith(source)] == whose


@pytest.mark.parametrize(
    ("name", "rating", "bound"),
    [("torque", {"torque": 20.0}, 20.0), ("ft", {"ft": 60.0}, 60.0), ("velocity", {"velocity": 1.0}, 3.0),
     ("velocity", {}, 3.0 * MOTOR / B), ("deflection", {}, 3.0 * MOTOR / K)],
)  # fmt: skip
def test_a_stated_limit_is_refused_beyond_what_the_machine_reaches(name, rating, bound):
    assert derive({name: bound * (1.0 - 1e-12)}, RIG, rating)[0][name] == pytest.approx(bound)
    assert derive({name: math.inf}, RIG, rating)[0][name] == math.inf
    with pytest.raises(ParameterError, match=f"parameter {name}_limit = .* expected at most"):
        derive({name: bound * 1.001}, RIG, rating)


def test_a_larger_stated_torque_moves_what_follows_from_it():
    more = 1.5 * MOTOR
    assert derive({"torque": more}, RIG)[0]["velocity"] == pytest.approx(0.8 * more / B)
    assert derive({"torque": more, "deflection": 2.99 * more / K}, RIG)[0]["torque"] == more
    with pytest.raises(ParameterError, match="deflection_limit"):
        derive({"torque": more, "deflection": 3.01 * more / K}, RIG)


@pytest.mark.parametrize(("ft", "left"), [(15.0, 15.0), (16.0, 0.01 * K)])
def test_behind_a_free_end_the_torque_limits_the_spring(ft, left):
    limits, sources = {"deflection": 0.01, "ft": ft}, {"deflection": "stated"}
    felt_through_spring(limits, sources, RIG)
    assert limits == pytest.approx({"deflection": math.inf, "ft": left})
    assert sources["deflection"] == "ft_limit limits it" and ("ft" in sources) == (left != ft)


def test_a_free_end_needs_a_limit_of_its_travel():
    free = load_rig("paper_moving_output")
    check_travel(math.inf, RIG)
    check_travel(1.0, free)
    with pytest.raises(ParameterError, match="housing_end of rig paper_moving_output is free"):
        check_travel(math.inf, free)
