"""Limits from parameters: for every rig, and refused where a limit cannot be applied."""

import math
from dataclasses import replace
from functools import partial

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Rating
from rsea_ros.hardware.simulated import SECOND, SimulatedDevice
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import check_travel
from rsea_ros.nodes import _control, _devices, driver
from rsea_ros.nodes._devices import DEVICES, devices_of, limits_of

DEFAULTS = {parameter.name: parameter.default for parameter in driver.TABLE}


def limits(**values):
    return limits_of(DEFAULTS | values)


def test_the_default_slew_limit_limits_within_a_cycle():
    """40 000 N m/s were 142 N m a cycle at 280 Hz."""
    assert limits().slew / DEFAULTS["rate"] < limits().torque
    assert limits().soft_start / DEFAULTS["rate"] < 2.0


@pytest.mark.parametrize(("rate", "cycles"), [(280.0, 3), (1000.0, 10), (100.0, 3)])
def test_replies_may_be_lost_for_the_same_time_at_any_rate(rate, cycles):
    """Three cycles at 1 kHz are 3 ms: any stall of the line was a fault, and 1 kHz never drove."""
    assert limits(rate=rate).lost_cycles == cycles


@pytest.mark.parametrize("rig", ["pd_joint", "paper_high_impedance"])
def test_a_controller_has_the_limits_of_its_driver(rig):
    """It had 68 and 110 N m whatever the rig."""
    values = {p.name: p.default for p in _control.TABLE} | {"rig": rig}
    driven = limits(rig=rig)
    stated = _control.with_limits(values | {"torque_limit": 2.0})
    assert _control.with_limits(values)["torque_limit"] == driven.torque
    assert (stated["torque_limit"], stated["ft_limit"]) == (2.0, 110.0)


def test_a_spring_with_a_free_end_is_limited_by_what_ft_measures():
    clamped, free = limits(), limits(rig="paper_moving_output", deflection_limit=0.05)
    assert (clamped.deflection, clamped.ft) == (math.radians(5.0), 110.0)
    assert math.isinf(free.deflection) and free.ft == pytest.approx(0.05 * 1530.456)
    assert "deflection_limit none (ft_limit limits it), ft_limit 76.52 N·m (deflection_limit" in str(free)


def test_an_angle_that_counts_from_the_motors_zero_is_not_the_springs():
    """The limit of the deflection was that of the joint: one way twice as far, the other not at all."""
    own_limits = limits(device="dynamixel_netft", position_zero="motor", deflection_limit=0.05)
    assert math.isinf(own_limits.deflection) and own_limits.ft == pytest.approx(0.05 * 1530.456)
    felt = limits(device="dynamixel_netft", position_zero="motor", encoder_id=5, ft_host="")
    assert felt.deflection == math.radians(5.0)
    with pytest.raises(ParameterError, match=r"deflection_limit = 0\.05 cannot be applied"):
        limits(device="dynamixel_netft", position_zero="motor", ft_host="", deflection_limit=0.05)


@pytest.mark.parametrize(("zero", "urdf"), [("configure", False), ("motor", False), ("robotis", True)])
def test_the_zero_of_the_urdfs_is_the_motors_affair(monkeypatch, zero, urdf):
    made = []
    monkeypatch.setattr(_devices, "MotorConnection", lambda _, **own: made.append(own) or MotorConnection(""))
    monkeypatch.setattr(_devices, "MotorNetft", lambda *_, **own: made.append(own))
    _devices.dynamixel_netft(DEFAULTS | {"device": "dynamixel_netft", "position_zero": zero})
    assert (made[0]["urdf_zero"], made[1]["zero"]) == (urdf, zero)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"rig": "bare_drive", "deflection_limit": 0.08}, "deflection_limit = 0.08 cannot be applied"),
        ({"rig": "bare_drive", "ft_limit": 110.0}, "ft_limit = 110 cannot be applied"),
        ({"rig": "paper_moving_output", "device": "dynamixel_netft", "ft_host": "",
          "deflection_limit": 0.08}, "deflection_limit = 0.08 cannot be applied to rig paper_moving_output"),
        ({"deflection_limit": 87.3}, r"deflection_limit = 87\.3 rad, expected at most 0\.1333 rad, 3 times"),
        ({"deflection_limit": 5.0}, "deflection_limit = 5 rad, expected at most"),
        ({"velocity_limit": 286.0}, r"velocity_limit = 286 rad/s, expected at most 8\.836 rad/s, 3 times"),
        ({"torque_limit": -0.5}, r"torque_limit = -0\.5, expected -1 to derive it, or at least 0"),
    ],
)  # fmt: skip
def test_a_limit_that_cannot_be_applied_or_reached_is_refused(values, told):
    """Milliradians and degrees of a limit were accepted: it limited nothing."""
    with pytest.raises(ParameterError, match=told):
        limits(**values)


def test_a_drive_on_can_has_no_limit_of_what_its_frames_do_not_tell():
    drive = {"device": "mit_can", "can_model": "AK80-9", "port": "can0", "joint": "hip"}
    made = limits(**drive)
    assert (made.current, made.voltage, made.temperature) == (math.inf, 0.0, 70.0)
    assert "current_limit none (its frames tell none)" in str(made)
    with pytest.raises(ParameterError, match=r"current_limit = 5 cannot be applied .*its frames tell none"):
        limits(**drive, current_limit=5.0)
    with pytest.raises(ParameterError, match=r"encoder_id = 3, expected -1: mit_can reads no encoder"):
        devices_of([DEFAULTS | drive | {"encoder_id": 3}], DEVICES)
    two = [DEFAULTS | drive | {"ft_host": "", **more} for more in ({}, {"joint": "knee"})]
    with pytest.raises(ParameterError, match=r"knee\.id = 1, expected another than hip's"):
        devices_of(two, DEVICES)
    devices, lines = devices_of([two[0], two[1] | {"id": 2}], DEVICES)
    assert len(devices) == 2 and lines == []


@pytest.mark.parametrize("value", [10_000.0, 180.0])
def test_a_position_limit_in_degrees_or_without_end_is_refused(value):
    """On a free end it stood for none, and was activated."""
    table = {parameter.name: parameter for parameter in driver.TABLE}
    with pytest.raises(ParameterError, match=r"expected a number from 0 to 18\.8496 rad"):
        table["position_limit"].check(value)


def test_limits_that_nobody_states_come_from_rig_motor_and_sensor():
    rig = limits()
    assert (rig.torque, rig.velocity) == (68.0, pytest.approx(0.8 * 68.0 / 23.088))
    assert "velocity_limit 2.356 rad/s (0.8 of what 68 N·m reach against the gear's damping)" in str(rig)
    small = limits_of(DEFAULTS, Rating(torque=10.0, velocity=0.3, ft=30.0))
    assert (small.torque, small.velocity, small.ft) == (10.0, 0.3, 30.0)
    assert "ft_limit 30 N·m (the F/T sensor's range)" in str(small)
    assert limits(rig="prototype_knee").torque == pytest.approx(260.0 * math.radians(5.0)), "of its spring"
    stop = load_rig("paper_high_impedance").with_effect("hard_stop", angle=0.02)
    assert limits(rig=stop).deflection == 0.02


def test_a_limit_that_is_stated_wins_unless_the_hardware_cannot_do_it():
    assert limits(velocity_limit=5.0, ft_limit=0.0).velocity == 5.0
    assert "velocity" not in limits(velocity_limit=5.0).derived
    for name, rating in (("torque", Rating(torque=10.0)), ("ft", Rating(ft=10.0))):
        with pytest.raises(ParameterError, match=f"{name}_limit = 20 N·m, expected at most 10 N·m, the"):
            limits_of(DEFAULTS | {f"{name}_limit": 20.0}, rating)


PRO, SMALL = (Rating(68.2, 3.5, 120.0, 9.99, 15.0, 40.0), Rating(2.13, 4.9, 20.0, 3.21, 9.5, 16.0))
"""Of an H54 and of an XM430 at 12 V."""


@pytest.mark.parametrize(
    ("name", "rating", "value", "expected"),
    [
        ("effort", PRO, None, 6.0), ("effort", SMALL, None, 0.5 * 2.13), ("effort", PRO, 34.0, 34.0),
        ("effort", PRO, 53.0, "53 N·m, expected at most 34 N·m, half of what the motor makes"),
        ("effort", SMALL, 6.0, "6 N·m, expected at most 1.065 N·m"),
        ("current", PRO, None, 1.2 * 9.99), ("current", SMALL, None, 1.2 * 3.21),
        ("current", PRO, 0.0, math.inf),
        ("current", PRO, 29.9, 29.9), ("current", PRO, 30.0, "30 A, expected at most 29.97 A, 3 times"),
        ("voltage", PRO, None, 20.0), ("voltage", SMALL, None, 10.8), ("voltage", PRO, 0.0, 0.0),
        ("voltage", PRO, 5.0, 5.0),
        ("voltage", PRO, 2.0, "2 V, expected at least 5 V, the motor's lowest by 3"),
        ("power", PRO, 250.0, 250.0), ("power", PRO, 480.0, 480.0),
        ("power", PRO, 2500.0, "2500 W, expected at most 480.7 W, 3 times what the motor makes at velocity"),
    ],
)  # fmt: skip
def test_limits_of_the_motor_are_derived_and_refused_in_another_unit(name, rating, value, expected):
    """600 N·m of effort, 30 A and 2 V were taken as they came, and 6 N·m limited no small motor."""
    values = DEFAULTS | ({} if value is None else {f"{name}_limit": value})
    if isinstance(expected, str):
        with pytest.raises(ParameterError, match=f"{name}_limit = {expected}"):
            limits_of(values, rating)
    else:
        made = limits_of(values, rating)
        assert getattr(made, name) == pytest.approx(expected)
        assert (name in made.derived) == (value is None)


@pytest.mark.parametrize(
    ("values", "told"),
    [({}, ""), ({"torque_limit": 0.69}, ""), ({"effort_limit": 0.061}, ""), ({"voltage_limit": 5.0}, ""),
     ({"torque_limit": 0.068}, "torque_limit = 0.068, where 68 is usual: is it in another unit?"),
     ({"effort_limit": 0.006, "velocity_limit": 0.002}, "velocity_limit = 0.002, where 2.356 is usual:"
      " is it in another unit?; effort_limit = 0.006, where 6 is usual: is it in another unit?")],
)  # fmt: skip
def test_a_limit_that_lets_nothing_move_is_told(values, told):
    assert limits_of(DEFAULTS | values, PRO).unlikely == told


@pytest.mark.parametrize(("rig", "value", "expected"), [
    ("paper_high_impedance", -1.0, 15.0), ("pd_joint", -1.0, None), ("paper_high_impedance", 67.0, 67.0),
    ("paper_high_impedance", 150.0, "error_limit = 150 N·m, expected at most 68 N·m, torque_limit"),
])  # fmt: skip
def test_an_error_that_no_torque_makes_is_no_limit(rig, value, expected):
    values = {parameter.name: parameter.default for parameter in _control.TABLE}
    values |= {"rig": rig, "error_limit": value}
    if isinstance(expected, str):
        with pytest.raises(ParameterError, match=expected):
            _control.with_limits(values)
    else:
        made = _control.with_limits(values)
        assert made["error_limit"] == (min(made["torque_limit"], 15.0) if expected is None else expected)


class Clock:
    """A clock that stands where it is put, ns."""

    now = 1_700_000_000 * SECOND

    def __call__(self):
        return self.now


@pytest.mark.parametrize("rig", ["paper_moving_output", "bare_drive", "prototype_knee"])
def test_60_newton_metres_on_a_free_end_are_refused_or_soon_a_fault(rig):
    """With all defaults they turned it by 5.9 rad in 3 s, without a fault."""
    values, clock = DEFAULTS | {"rig": rig}, Clock()
    with pytest.raises(ParameterError, match=r"position_limit = 0 rad \(none\), expected one: \w+ of rig"):
        check_travel(limits_of(values).position, load_rig(rig))
    device = SimulatedDevice(load_rig(rig), values["rate"], clock=clock)
    joint = GuardedDevice(device, limits_of(values), values["rate"], derive=partial(limits_of, values))
    joint.open()
    joint.enable()
    for _ in range(840):
        clock.now += round(SECOND / values["rate"])
        joint.cycle(60.0, 0.0)
        if joint.fault is not None:
            break
    assert joint.fault.cause == "velocity" and abs(joint.state.position) < 1.0


def effects(**parameters):
    return RIG.with_effects(*(EffectSetting(name, values) for name, values in parameters.items()))


RIG = load_rig("paper_high_impedance")
STRIBECK = {"coulomb_torque": 2.0, "stribeck_torque": 1.0, "stribeck_velocity": 0.1, "creep_velocity": 2e-3}


@pytest.mark.parametrize(
    ("rig", "play", "friction", "late"),
    [
        (RIG, 0.0, 0.0, 0.0), (effects(backlash={"gap": 0.01}), 0.01 * 1530.456, 0.0, 0.0),
        (effects(coulomb_friction={"torque": 4.0}), 0.0, 4.0, 0.0),
        (effects(stribeck_friction=STRIBECK), 0.0, 2.0, 0.0),
        (replace(RIG, sensors=RIG.sensors | {"ft": replace(RIG.sensors["ft"], delay=0.03)}), 0.0, 0.0, 0.03),
    ],
)  # fmt: skip
def test_the_doubts_of_the_witnesses_are_those_of_the_rig(monkeypatch, rig, play, friction, late):
    made = []
    monkeypatch.setattr(_devices, "load_rig", lambda name: rig)
    monkeypatch.setattr(_devices, "Witnesses", lambda *given: made.append(given))
    _devices.witnesses_of(DEFAULTS | {"rate": 250.0}, Rating(torque=20.0))
    ((spring, actuator, period),) = made
    assert (spring.stiffness, period) == (1530.456, 0.004)
    assert (actuator.damping, actuator.inertia, actuator.drag) == (3.0, 0.953, 23.088) and actuator.by_angle
    spreads = [3.0 * rig.spread(n) for n in ("spring.stiffness", "rotor.reflected_inertia")]
    assert actuator.bent == pytest.approx(math.hypot(0.2, spreads[0])) and actuator.driven == 0.3
    assert actuator.risen == pytest.approx(max(0.3, spreads[1]))
    assert actuator.dragged == pytest.approx(max(0.5, 3.0 * rig.spread("rotor.reflected_damping")))
    assert actuator.play == pytest.approx(0.4 + play) and actuator.friction == pytest.approx(2.0 + friction)
    assert (actuator.creep, actuator.late) == pytest.approx((2e-3, 0.01 + late))


@pytest.mark.parametrize("rig", ["bare_drive", "pendulum"])
def test_without_a_spring_nothing_witnesses(rig):
    assert _devices.witnesses_of(DEFAULTS | {"rig": rig}) is None
