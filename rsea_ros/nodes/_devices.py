"""Devices of the driver: parameters to a device and its limits."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from msg_adapters.topic_map import sign_and_index
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.hardware.bus_motor import BusMotor
from rsea_ros.hardware.device import Device, Spring
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.encoder import BusEncoder, EncoderConnection
from rsea_ros.hardware.dynamixel.line import Line, LineMotor
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel.port import BAUD_RATES
from rsea_ros.hardware.limits import UNRATED, Limits, Rating
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.motor_netft import CONFIGURE, ROBOTIS, MotorNetft
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.outside import outside_device
from rsea_ros.hardware.witnesses import Actuator, Witnesses
from rsea_ros.model.rig import END_NAMES, Rig, motor_torque
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import derive, derive_rest, felt_through_spring
from rsea_ros.nodes._parameters import stated_limits

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
