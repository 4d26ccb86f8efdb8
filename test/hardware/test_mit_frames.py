"""Frames of the drives on CAN, each against an encoder of somebody else."""

import math
import random
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from CyberGearDriver import CyberGearMotor
from damiao_motor.core.motor import DaMiaoMotor
from robstride.client import Client, MotorMode, MotorMsg
from robstride_dynamics import Motor, RobstrideBus

from rsea_ros.errors import ParameterError
from rsea_ros.hardware.mit_can.frames import RANGES, Frame, _families, count, drive_table, frames_of, value

MODELS = {family: list(content["models"]) for family, content in _families().items()}
STANDARD = MODELS["damiao"] + MODELS["cubemars"] + MODELS["mini_cheetah"]
EXTENDED = MODELS["robstride"] + MODELS["cybergear"]
HOST, ID = 0xFD, 11


def damiao(model, identity=ID):
    """Return damiao-motor with the ranges of a model; its layout is that of every standard frame."""
    table = drive_table(model)
    ranges = {
        f"{name[0]}_{end}": sign * getattr(table, name) for name in RANGES
        for end, sign in (("min", -1), ("max", 1))
    }  # fmt: skip
    return DaMiaoMotor(identity, 0, SimpleNamespace(), motor_type="4310", **ranges)


def torques(most):
    """Return torques in and beyond a range: at its ends, next to zero, and anywhere."""
    draw = random.Random(5)
    return [0.0, most, -most, 2.0 * most, -3.0 * most, *(draw.uniform(-most, most) for _ in range(200))]


def fields(data):
    """Return position, velocity, stiffness, damping and torque of a standard command, in counts."""
    whole = int.from_bytes(data, "big")
    return [whole >> 48, *(whole >> shift & 0xFFF for shift in (36, 24, 12, 0))]


@pytest.mark.parametrize("model", STANDARD)
def test_a_standard_command_is_that_of_damiao_motor_but_for_the_rounding(model):
    other, table = damiao(model), drive_table(model)
    frames = frames_of(table, ID)
    for torque in torques(table.torque):
        frame = frames.command(torque)
        theirs = fields(other.encode_cmd_msg(0.0, 0.0, torque, 0.0, 0.0))
        ours = fields(frame.data)
        assert frame.identity == ID and not frame.extended and len(frame.data) == 8
        assert ours[2:4] == [0, 0], "no stiffness, no damping"
        assert all(0 <= a - b <= 1 for a, b in zip(ours, theirs, strict=True)), "they cut off, we round"
        cut = max(-table.torque, min(table.torque, torque))
        assert abs(value(ours[4], table.torque, 12) - cut) <= table.torque / 4095 * 1.0001


def test_the_codes_of_standard_frames_are_those_of_damiao_motor():
    frames = frames_of(drive_table("DM4310"), ID)
    assert frames.enable() == Frame(ID, DaMiaoMotor.encode_enable_msg())
    assert frames.disable() == Frame(ID, DaMiaoMotor.encode_disable_msg())
    assert frames.clear() == Frame(ID, DaMiaoMotor.encode_clear_error_msg())


@pytest.mark.parametrize("model", MODELS["damiao"])
def test_a_reading_of_damiao_is_that_of_damiao_motor(model):
    other, frames, draw = damiao(model), frames_of(drive_table(model), ID), random.Random(3)
    for code in (0, 1, 1, 1, 8, 9, 10, 11, 12, 13, 14):
        data = bytes((code << 4 | ID, *(draw.randrange(1, 256) for _ in range(5)), 41, 57))
        theirs, ours = other.decode_sensor_feedback(data), frames.feedback(Frame(0, data))
        assert value(ours.counts, frames.table.position, 16) == pytest.approx(theirs["pos"])
        assert (ours.velocity, ours.torque) == pytest.approx((theirs["vel"], theirs["torq"]))
        assert ours.temperature == 57.0
        assert (ours.state == "enabled") == (theirs["status"] == "ENABLED")
        assert bool(ours.error) == (code >= 8)
    assert frames.feedback(Frame(0, bytes((1 << 4 | 12, *data[1:])))) is None, "of another drive"
    assert frames.feedback(Frame(5, data)) is None, "to another host"


def test_registers_of_damiao_are_those_of_damiao_motor():
    sent = []
    other, frames = damiao("DM4310"), frames_of(drive_table("DM4310"), ID)
    other.send_raw = lambda data, arbitration_id=None: sent.append(Frame(arbitration_id, bytes(data)))
    other.request_register_reading(21)
    assert frames.ask("position") == sent[-1]
    other.write_register(9, 2000)
    assert frames.tell("watchdog", 2000) == sent[-1]
    take, reply = frames.answer("position"), bytes((ID, 0, 0x33, 21)) + struct.pack("<f", 12.5)
    assert take(Frame(0, reply)) == 12.5 and take(Frame(0, bytes(8))) is None
    assert frames.feedback(Frame(0, reply)) is None, "no reading"


def robstride(model):
    """Return the encoder of robstride-dynamics with the ranges of a model."""
    sent, table = [], drive_table(model)
    bus = object.__new__(RobstrideBus)
    bus.motors, bus.calibration, bus.host_id = {"m": Motor(ID, "rs-02")}, None, HOST
    bus.channel_handler = None
    bus.transmit = lambda kind, extra, identity, data: sent.append(
        Frame(int(kind) << 24 | int(extra) << 8 | identity, bytes(data), True)
    )
    return bus, sent, table


@pytest.mark.parametrize("model", EXTENDED)
def test_an_extended_command_is_that_of_robstride_dynamics_but_for_the_rounding(model, monkeypatch):
    bus, sent, table = robstride(model)
    import robstride_dynamics.bus as theirs

    for name, most in (("POSITION", table.position), ("VELOCITY", table.velocity), ("TORQUE", table.torque)):
        monkeypatch.setitem(getattr(theirs, f"MODEL_MIT_{name}_TABLE"), "rs-02", most)
    frames = frames_of(table, ID)
    for torque in torques(table.torque):
        bus.write_operation_frame("m", 0.0, 0.0, 0.0, 0.0, np.clip(torque, -table.torque, table.torque))
        ours, other = frames.command(torque), sent[-1]
        assert ours.extended and ours.identity >> 24 == other.identity >> 24 == 1
        assert ours.identity & 0xFF == other.identity & 0xFF == ID
        assert 0 <= (ours.identity >> 8 & 0xFFFF) - (other.identity >> 8 & 0xFFFF) <= 2, "its scale is 65534"
        parts = zip(struct.unpack(">4H", ours.data), struct.unpack(">4H", other.data), strict=True)
        assert all(0 <= a - b <= 1 for a, b in parts) and ours.data[4:] == bytes(4)


def test_the_command_of_a_cybergear_is_that_of_cybergeardriver():
    sent = []
    other = CyberGearMotor(ID, lambda m: sent.append(Frame(m.arbitration_id, bytes(m.data), True)))
    frames = frames_of(drive_table("CyberGear"), ID)
    for torque in torques(12.0):
        other.control(position=0.0, velocity=0.0, torque=torque, kp=0.0, kd=0.0)
        ours = frames.command(torque)
        assert 0 <= (ours.identity >> 8 & 0xFFFF) - (sent[-1].identity >> 8 & 0xFFFF) <= 1
        assert ours.identity & ~0xFFFF00 == sent[-1].identity & ~0xFFFF00
        assert ours.data[4:] == sent[-1].data[4:]
    for wish, frame in ((other.enable, frames.enable()), (other.stop, frames.disable())):
        wish()
        assert sent[-1].identity & ~0xFFFF00 == frame.identity & ~0xFFFF00
        assert sent[-1].data.ljust(8, b"\0") == frame.data


class Heard:
    """A bus of python-can that keeps what is sent, and answers with one message."""

    def __init__(self, answer):
        self.sent, self._answer = [], answer

    def send(self, message):
        """Keep it."""
        self.sent.append(Frame(message.arbitration_id, bytes(message.data), message.is_extended_id))

    def recv(self, timeout):
        """Answer."""
        return self._answer


@pytest.mark.parametrize(("mode", "state"), [(0, "reset"), (1, "calibration"), (2, "run")])
def test_a_reading_of_an_extended_frame_is_that_of_robstride(mode, state):
    """Its ranges of model 1 are those of RS01 and RS02; of mode and faults it reads all bits but the last."""
    frames, draw = frames_of(drive_table("RS02"), ID), random.Random(8)
    for bits in (0, 1, 2, 4, 8, 16, 5):
        data = struct.pack(">4H", *(draw.randrange(65536) for _ in range(3)), 384)
        identity = 2 << 24 | mode << 22 | bits << 16 | ID << 8 | HOST
        message = SimpleNamespace(
            arbitration_id=identity & ~(0xC0 << 16), data=data, is_error_frame=False
        )  # fmt: skip
        bus = Heard(message)
        theirs = Client(bus, host_can_id=HOST).enable(ID)
        ours = frames.feedback(Frame(identity, data, True))
        assert bus.sent == [frames.enable()]
        assert value(ours.counts, 4.0 * math.pi, 16) == pytest.approx(theirs.angle, abs=1e-6)
        assert (ours.velocity, ours.torque) == pytest.approx((theirs.velocity, theirs.torque))
        assert ours.temperature == pytest.approx(theirs.temp) and ours.state == state
        assert len(ours.error.split(", ")) * bool(ours.error) == len(theirs.errors)
    assert theirs.mode is MotorMode.Reset and MotorMsg.Feedback.value == 2
    assert frames.feedback(Frame(identity | 32 << 16, data, True)).error.endswith("not calibrated")
    for wrong in (identity & ~0xFF, identity ^ 1 << 8, identity ^ 1 << 24):
        assert frames.feedback(Frame(wrong, data, True)) is None


@pytest.mark.parametrize("model", ("RS02", "CyberGear"))
def test_parameters_of_extended_frames_are_those_of_robstride(model):
    frames = frames_of(drive_table(model), ID)
    reply = struct.pack("<HHf", 0x700B, 0, 17.0)
    bus = Heard(SimpleNamespace(arbitration_id=17 << 24 | ID << 8 | HOST, data=reply, is_error_frame=False))
    assert Client(bus, host_can_id=HOST).read_param(ID, "limit_torque") == 17.0
    assert bus.sent == [frames.ask("torque_limit")]
    answer = Frame(17 << 24 | ID << 8 | HOST, reply, True)
    assert frames.answer("torque_limit")(answer) == 17.0 and frames.answer("mode")(answer) is None
    feedback = SimpleNamespace(arbitration_id=2 << 24 | ID << 8 | HOST, data=bytes(8), is_error_frame=False)
    bus = Heard(feedback)
    Client(bus, host_can_id=HOST).write_param(ID, "run_mode", 0)
    assert bus.sent == [frames.tell("mode", 0)]


@pytest.mark.parametrize("bits", (12, 16))
def test_a_count_is_the_nearest_and_no_value_leaves_its_range(bits):
    top = 2**bits - 1
    assert [count(x, 5.0, bits) for x in (-9.0, -5.0, 5.0, 9.0)] == [0, 0, top, top]
    assert all(count(value(k, 5.0, bits), 5.0, bits) == k for k in range(0, top + 1, 7))
    assert abs(value(count(0.0, 5.0, bits), 5.0, bits)) == pytest.approx(5.0 / top), "there is no zero"


def test_a_model_that_nobody_knows_is_refused_and_a_file_states_ones_own(tmp_path):
    with pytest.raises(ParameterError, match=r"expected one of AK10-9, .*DM4310.*, or a YAML file"):
        drive_table("AK47")
    path = tmp_path / "mine.yaml"
    path.write_text("family: cubemars\nposition: 12.5\nvelocity: 41.87\ntorque: 18\n")
    table = drive_table(str(path))
    assert (table.name, table.velocity, table.wraps) == ("mine", 41.87, 65536)
    path.write_text("family: cubemars\nposition: 12.5\n")
    with pytest.raises(ParameterError, match=r"expected a file with family .*position, velocity, torque"):
        drive_table(str(path))
