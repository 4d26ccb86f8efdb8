"""Devices of the driver: their parameters, the limits from these, and the buses that joints share."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from msg_adapters.topic_map import sign_and_index
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.hardware.bus_motor import BusMotor
from rsea_ros.hardware.device import Device, Spring
from rsea_ros.hardware.dynamixel.bus import BAUD_RATES
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.encoder import LINK, SPRING, BusEncoder, EncoderConnection
from rsea_ros.hardware.dynamixel.line import Line, LineMotor
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.limits import UNRATED, Limits, Rating
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.motor_netft import CONFIGURE, ROBOTIS, ZEROS, MotorNetft
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.outside import outside_device
from rsea_ros.hardware.witnesses import Actuator, Witnesses
from rsea_ros.model.rig import END_NAMES, Rig, motor_torque
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import POWER, SLEW, derive, derive_rest, felt_through_spring
from rsea_ros.nodes._parameters import AXIS, DERIVED, NodeParameter, stated_limits

Values = Mapping[str, Any]

DERIVABLE = ("torque", "deflection", "velocity", "ft", "effort", "current", "voltage", "power")
TINY = 0.01
"""Of the limit that would be derived: a stated one below that is warned of, as one in another unit."""


def limits_of(values: Values, rating: Rating = UNRATED) -> Limits:
    """Return the limits that the parameters set, and those that rig and hardware derive.

    Where the drive's angle is not the spring's, the torque that is felt limits the spring. Raises
    ParameterError for a limit that cannot be applied, or is beyond what the machine can do.
    """
    rig = load_rig(values["rig"])
    stated = stated_limits(values, DERIVABLE)
    inapplicable = _inapplicable(values, rig)
    for name, why in inapplicable.items():
        if math.isfinite(stated.get(name, math.inf)):
            raise ParameterError(
                f"parameter {name}_limit = {stated[name]:g} cannot be applied to rig {rig.name}"
                f" ({why}), expected 0 for none"
            )
    limits, sources = derive(stated, rig, vars(rating))
    motor = max(min(motor_torque(rig)[0], rating.torque), stated.get("torque", 0.0))
    able = limits["torque"], motor, limits["velocity"], vars(rating)
    more, whence = derive_rest(stated, *able)
    limits, sources = limits | more, sources | whence
    usual = derive({}, rig, vars(rating))[0] | derive_rest({}, *able)[0]
    unlikely = [
        f"{name}_limit = {value:g}, where {usual[name]:.4g} is usual: is it in another unit?"
        for name, value in stated.items() if value < TINY * usual[name]
    ]  # fmt: skip
    for name, why in inapplicable.items():
        limits[name] = math.inf
        if name in sources:
            sources[name] = why
    by_angle = _deflects(values, rig)
    if not by_angle and "deflection" not in inapplicable:
        felt_through_spring(limits, sources, rig)
    return Limits(
        torque=limits["torque"],
        slew=values["slew_limit"],
        deflection=limits["deflection"],
        temperature=values["temperature_limit"] or math.inf,
        current=limits["current"],
        voltage=limits["voltage"] if math.isfinite(limits["voltage"]) else 0.0,
        command_timeout=values["command_timeout"],
        ramp=values["ramp"],
        lost_cycles=max(values["lost_cycles"], math.ceil(values["lost_time"] * values["rate"])),
        velocity=limits["velocity"],
        position=values["position_limit"] or math.inf,
        ft=limits["ft"],
        power=limits["power"],
        soft_start=values["soft_start"],
        effort=limits["effort"],
        effort_time=values["effort_time"],
        ft_axis=sign_and_index(values["axis"])[1],
        derived=sources,
        unlikely="; ".join(unlikely),
    )


def spring_of(values: Values) -> Spring | None:
    """Return the rig's spring as a torque sensor, where a device measures its deflection; None: rigid."""
    rig = load_rig(values["rig"])
    if rig.rigid_spring:
        return None
    sign, place = sign_and_index(values["axis"])
    return Spring(rig["spring.stiffness"], place, sign)


def witnesses_of(values: Values, rating: Rating = UNRATED) -> Witnesses | None:
    """Return what holds ft against deflection and motor torque; None where nothing can.

    Doubts are three of the rig's standard deviations, and at least what gains, laws of the spring and
    friction that the rig does not state make (decision 314).
    """
    rig, spring = load_rig(values["rig"]), spring_of(values)
    if spring is None or rig.encoder_end != "gear_output":
        return None
    names = ("spring.stiffness", "rotor.reflected_inertia", "rotor.reflected_damping")
    stiffness, inertia, damping = (3.0 * rig.spread(name) for name in names)
    stated = {name: value for effect in rig.effects for name, value in effect.parameters.items()}
    torque = min(motor_torque(rig)[0], rating.torque)
    actuator = Actuator(
        damping=rig["spring.damping"], inertia=rig["rotor.reflected_inertia"],
        drag=rig["rotor.reflected_damping"], by_angle=_deflects(values, rig),
        bent=math.hypot(0.2, stiffness), driven=0.3, risen=max(0.3, inertia), dragged=max(0.5, damping),
        play=0.02 * torque + spring.stiffness * stated.get("gap", 0.0),
        friction=0.1 * torque + stated.get("torque", 0.0) + stated.get("coulomb_torque", 0.0),
        creep=2e-3, late=0.01 + max((s.lag(1.0 / values["rate"]) for s in rig.sensors.values()), default=0.0),
    )  # fmt: skip
    return Witnesses(spring, actuator, 1.0 / values["rate"])


def device_of(values: Values, known: Mapping[str, Callable[[Values], Device]]) -> Device:
    """Return the requested device, of the package or of RSEA_DEVICES, not open.

    Raises ParameterError for one that does not exist or cannot be made.
    """
    if values["device"] in known:
        return known[values["device"]](values)
    kind = outside_device(values["device"], known)
    try:
        return kind.make(values)
    except RseaError:
        raise
    except Exception as error:  # code of somebody else
        raise ParameterError(f"device {kind.name}: {type(error).__name__}: {error}") from error


def _deflects(values: Values, rig: Rig) -> bool:
    """Return whether the drive's angle is the spring's, or an encoder measures that.

    Between clamped ends it is, as long as it counts from configure, with the spring at rest.
    """
    counts = values["position_zero"] == CONFIGURE or values["encoder_id"] >= 0
    return counts and rig.clamped == set(END_NAMES)


def _feels(values: Values, rig: Rig) -> bool:
    """Return whether the torque of the spring's distal side is measured."""
    if rig.rigid_spring:
        return False
    if values["device"] in DEVICES:
        return values["device"] == "simulated" or bool(values["ft_host"]) or values["encoder_id"] >= 0
    return outside_device(values["device"], DEVICES).feels


def _inapplicable(values: Values, rig: Rig) -> dict[str, str]:
    """Return the limits of quantities that this bench does not measure, and why it does not."""
    feels = _feels(values, rig)
    why = "ft_host is empty and encoder_id is -1: nothing measures it"
    if rig.rigid_spring:
        why = "its spring is rigid"
    if values["device"] not in DEVICES:
        why = f"device {values['device']} does not measure it"
    deflects = _deflects(values, rig) and not rig.rigid_spring
    untold = dict.fromkeys(("current", "voltage"), "its frames tell none") if values["device"] == CAN else {}
    return untold | {
        name: why for name, applicable in (("deflection", feels or deflects), ("ft", feels)) if not applicable
    }


def _simulated_device(values: Values) -> Device:
    from rsea_ros.hardware.simulated import SimulatedDevice  # and a compiler, which no real bench needs

    return SimulatedDevice(load_rig(values["rig"]), values["rate"], seed=values["seed"])


def dynamixel_netft(values: Values, line: Line | None = None) -> Device:
    """Return motor and sensor, not open. line: of a motor that shares its port. Raises ParameterError."""
    if values["baud"] not in BAUD_RATES:
        known = ", ".join(map(str, BAUD_RATES))
        raise ParameterError(f"parameter baud = {values['baud']} bit/s, expected one of {known}")
    alike = ("baud", "model", "torque_constant", "watchdog", "supervisor")
    own = {name: values[name] for name in alike} | {"urdf_zero": values["position_zero"] == ROBOTIS}
    motor = MotorConnection(values["port"], identity=values["id"], latency=latency_of(values), **own)
    made, encoder = Motor(motor) if line is None else LineMotor(motor, line), _encoder(values)
    return _with_sensor(values, made, BusEncoder(encoder, made.port) if encoder is not None else None)


def mit_can(values: Values) -> Device:
    """Return a drive on a CAN bus and the sensor, not open. Raises ParameterError."""
    if values["encoder_id"] >= 0:
        raise ParameterError(
            f"parameter encoder_id = {values['encoder_id']}, expected -1: {CAN} reads no encoder"
        )
    own = {name: values[name] for name in ("baud", "watchdog", "supervisor")}
    latency = float(values["latency"] or usual_latency(values["rate"], 1))
    names = {name: values[f"can_{name}"] for name in ("model", "interface", "host")}
    drive = CanConnection(values["port"], identity=values["id"], latency=latency, **names, **own)
    return _with_sensor(values, MitMotor(drive))


def _with_sensor(values: Values, motor: BusMotor, encoder: BusEncoder | None = None) -> Device:
    rig = load_rig(values["rig"])
    sensor = SensorConnection(*(values[f"ft_{name}"] for name in ("host", "port", "page_port", "timeout")))
    return MotorNetft(
        motor,
        sensor if values["ft_host"] else None,
        limits_of(values),
        math.inf if rig.rigid_spring else rig["spring.stiffness"],
        zero=values["position_zero"],
        encoder=encoder,
    )


def _encoder(values: Values) -> EncoderConnection | None:
    """Return the encoder of the spring, None without. Raises ParameterError."""
    identity = values["encoder_id"]
    if identity < 0:
        return None
    for name, wrong in (("encoder_id", values["id"]), ("encoder_pulses", 0.0)):
        if values[name] == wrong:
            expected = "another than that of the motor" if name == "encoder_id" else "counts of a turn"
            raise ParameterError(f"parameter {name} = {wrong:g}, expected {expected}")
    address, pulses, place = (values[f"encoder_{name}"] for name in ("address", "pulses", "place"))
    return EncoderConnection(identity, address, pulses, place, latency_of(values))


def latency_of(values: Values) -> float:
    """Return the allowed lateness of a reply, s."""
    replies = 2 + (values["encoder_id"] >= 0)
    return float(values["latency"] or usual_latency(values["rate"], replies))


DYNAMIXEL, CAN = "dynamixel_netft", "mit_can"
DEVICES: Mapping[str, Callable[[Values], Device]] = {
    "simulated": _simulated_device,
    DYNAMIXEL: dynamixel_netft,
    CAN: mit_can,
}


MOTOR = (
    NodeParameter("port", "/dev/ttyUSB0", "serial port of the motor, or CAN channel, such as can0"),
    NodeParameter("baud", 1_000_000, "of port or CAN bus, as the motor is set", "bit/s", 9600, 10_500_000),
    NodeParameter("fast_sync", False, "whether several motors on a port answer in one packet"),
    NodeParameter("id", 1, "of the motor on its bus", "", 0, 252),
    NodeParameter(
        "model", 0, "number that the motor must have (docs/hardware.md); 0: any that is known", "", 0, 65535
    ),
    NodeParameter("can_model", "", "of the drive of mit_can (docs/devices.md), or a YAML file of its ranges"),
    NodeParameter("can_interface", "socketcan", "of python-can, such as socketcan, slcan, virtual"),
    NodeParameter("can_host", -1, "identifier of the drive's replies; -1: its family's", "", -1, 2047),
    NodeParameter("torque_constant", 0.0,
                  "torque at the gear output for a current; 0: that of the model's table",
                  "N m/A", 0.0, 100.0),
    NodeParameter("position_zero", ZEROS[0], choices=ZEROS,
                  description="where angles are zero: where configure finds it, the motor's own zero, or"
                  " that of ROBOTIS's URDFs"),
    NodeParameter("latency", 0.0,
                  "what adapter and host may add to a reply; 0: by the rate, docs/hardware.md",
                  "s", 0.0, 0.1),
    NodeParameter("watchdog", 0.1,
                  "time without the driver after which the motor is stopped", "s", 0.02, 2.5),
    NodeParameter("supervisor", "", "socket of a supervisor that runs as a service; empty: a child process"),
)  # fmt: skip
ENCODER = (
    NodeParameter("encoder_id", -1, "of an encoder on the motor's bus that measures the spring; -1: none",
                  "", -1, 252),
    NodeParameter("encoder_address", 132, "of its angle, 4 bytes, signed", "", 0, 65535),
    NodeParameter("encoder_pulses", 4096.0, "counts of a turn; negative: they fall as the angle grows",
                  "", -1e9, 1e9),
    NodeParameter("encoder_place", SPRING,
                  "what it measures: the spring's deflection, or the link relative to the housing",
                  choices=(SPRING, LINK)),
)  # fmt: skip
SAFETY = (
    NodeParameter(
        "allow_no_dead_host_protection", False,
        "whether a device is driven whose torque nothing ends when this process dies",
    ),
    NodeParameter(
        "allow_no_position_limit", False, "whether a free end is activated without a position_limit"
    ),
    NodeParameter("device_options", "", "of a device of RSEA_DEVICES: NAME=VALUE,…"),
)  # fmt: skip
"""Of every device."""
SENSOR = (
    NodeParameter("ft_host", "192.168.1.1", "address of the F/T sensor; empty: there is none"),
    NodeParameter("ft_port", 49152, "UDP port of its stream", "", 1, 65535),
    NodeParameter("ft_page_port", 80, "TCP port of its web page", "", 1, 65535),
    NodeParameter("ft_timeout", 0.01, "time without a record that is a fault", "s", 0.001, 1.0),
    NodeParameter("ft_all", False, "whether ft has every record, or one a cycle"),
)
LIMITS = (
    NodeParameter(
        "torque_limit", DERIVED, "largest torque that is commanded; -1: derived", "N m", DERIVED, 1000.0
    ),
    NodeParameter("slew_limit", SLEW, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    NodeParameter(
        "soft_start", 500.0, "growth of the limit after activation, fault, pause", "N m/s", 1.0, 1e5
    ),
    NodeParameter("deflection_limit", DERIVED, "of the spring; 0: none; -1: derived", "rad", DERIVED, 100.0),
    NodeParameter(
        "velocity_limit", DERIVED, "of the gear output; 0: none; -1: derived", "rad/s", DERIVED, 1000.0
    ),
    NodeParameter(
        "position_limit", 0.0, "either way from zero (position_zero), 3 turns at most; 0: none",
        "rad", 0.0, 3.0 * math.tau,
    ),
    NodeParameter(
        "ft_limit", DERIVED, "of the torque that ft measures; 0: none; -1: derived", "N m", DERIVED, 1000.0
    ),
    NodeParameter("power_limit", POWER, "of the motor torque times velocity; 0: none", "W", 0.0, 1e5),
    NodeParameter(
        "effort_limit", DERIVED, "by which measured may miss commanded; 0: none; -1: derived", "N m",
        DERIVED, 1000.0,
    ),
    NodeParameter("effort_time", 0.1, "for which it may", "s", 0.0, 10.0),
    NodeParameter("temperature_limit", 70.0, "of the motor; 0: none", "°C", 0.0, 100.0),
    NodeParameter(
        "current_limit", DERIVED, "of the motor, measured; 0: none; -1: derived", "A", DERIVED, 100.0
    ),
    NodeParameter("voltage_limit", DERIVED, "lowest supply; 0: none; -1: derived", "V", DERIVED, 100.0),
    NodeParameter("command_timeout", 0.05, "time without a command that ends the torque", "s", 0.001, 10.0),
    NodeParameter("ramp", 0.02, "from there to zero torque", "s", 0.0, 10.0),
    NodeParameter("lost_cycles", 3, "cycles in a row without an answer that are a fault", "", 1, 100),
    NodeParameter("lost_time", 0.01, "which they last at least, at any rate", "s", 0.0, 0.1),
    AXIS,
)  # fmt: skip


def devices_of(
    joints: Sequence[Values], known: Mapping[str, Callable[[Values], Device]]
) -> tuple[list[Device], list[Line]]:
    """Return the device of each joint, not open, and the lines that some of them share.

    Raises ParameterError for devices that do not exist, cannot be made or are in each other's way.
    """
    lines = _lines(joints)
    devices = []
    for values in joints:
        line = lines.get(values["port"]) if values["device"] == DYNAMIXEL else None
        devices.append(dynamixel_netft(values, line) if line is not None else device_of(values, known))
    return devices, list(lines.values())


def _lines(joints: Sequence[Values]) -> dict[str, Line]:
    """Return the line of each port that several joints share. Raises ParameterError for two that collide."""
    on_buses = [values for values in joints if values["device"] in (DYNAMIXEL, CAN)]
    for values in on_buses:
        for other in on_buses[: on_buses.index(values)]:
            _check_apart(values, other)
    motors = [values for values in on_buses if values["device"] == DYNAMIXEL]
    ports = [values["port"] for values in motors]
    return {
        values["port"]: Line(values["port"], values["baud"], latency_of(values), fast=values["fast_sync"])
        for values in motors
        if ports.count(values["port"]) > 1
    }


def _check_apart(values: Values, other: Values) -> None:
    """Raise ParameterError where two joints have one motor or sensor, or want their port differently."""
    joint, other_joint = values["joint"], other["joint"]
    places = [(each["ft_host"], each["ft_port"]) for each in (values, other)]
    if values["ft_host"] and places[0] == places[1]:
        raise ParameterError(
            f"parameter {joint}.ft_host = {values['ft_host']}, expected another than {other_joint}'s: a"
            " sensor has one client (empty: there is none)"
        )
    if values["port"] != other["port"] or values["device"] != other["device"]:
        return
    for name in ("id", "encoder_id"):
        if values[name] >= 0 and values[name] in (other["id"], other["encoder_id"]):
            text = f"parameter {joint}.{name} = {values[name]}, expected another than {other_joint}'s"
            raise ParameterError(text)
    for name in ("baud", "latency", "fast_sync"):
        if values[name] != other[name]:
            text = f"{other[name]} as {other_joint}'s on {values['port']}"
            raise ParameterError(f"parameter {joint}.{name} = {values[name]}, expected {text}")
