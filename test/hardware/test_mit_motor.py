"""A drive on CAN: what bus and drive may do wrong, and that nothing moves by accident."""

import errno
import math
import sys
import threading
import time
from contextlib import ExitStack
from dataclasses import replace
from itertools import count

import can
import pytest

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.device import NoReply, PortLost, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.motor_netft import MotorNetft
from rsea_ros.hardware.peer.can_drive import EmulatedDrive
from test.hardware.conftest import PERIOD, Loop, device_on, limits_on, well_behaved
from test.nodes.stalls import is_stall, until

CHANNELS = count()


class Mass:
    """A plant without a clock: at the angle that the test sets, with the torque that is written."""

    position = torque = 0.0

    def read(self):
        """Return its state."""
        return State(0, self.position, 0.0, self.torque)

    def write(self, torque):
        """Hold a torque."""
        self.torque = torque


class Virtual:
    """Drives on a virtual bus of python-can, whose peer is a thread of this process."""

    def __init__(self, *models):
        self.channel = f"test{next(CHANNELS)}"
        self.bus = can.Bus(interface="virtual", channel=self.channel)
        self.plants = [Mass() for _ in models]
        self.drives = [EmulatedDrive(name, each) for name, each in zip(models, self.plants, strict=True)]
        self.heard, self.motors, self._end = [], [], threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self):
        while not self._end.is_set():
            message = self.bus.recv(0.01)
            if message is None:
                continue
            heard = message.arbitration_id, message.is_extended_id, bytes(message.data)
            self.heard.append(heard)
            now = time.monotonic_ns()
            answers = [answer for drive in self.drives for answer in drive.hear(now, heard)]
            for identity, extended, data in answers:  # at once: twins answer within one frame of each other
                self.tell(identity, data, extended)

    def tell(self, identity, data=b"", extended=False, error=False):
        """Send a frame to the host."""
        self.bus.send(can.Message(
            arbitration_id=identity, data=data, is_extended_id=extended, is_error_frame=error
        ))  # fmt: skip

    def motor(self, model, **more):
        """Return the driver's end of a drive."""
        usual = {"interface": "virtual", "latency": 2.0}  # what a stall of its thread does not reach
        self.motors.append(MitMotor(CanConnection(self.channel, model, **(usual | more))))
        return self.motors[-1]

    def close(self):
        """End it, and the motors first."""
        for motor in self.motors:
            motor.close()
        self._end.set()
        self._thread.join()
        self.bus.shutdown()


@pytest.fixture
def virtual():
    """A function that makes a virtual bus with drives."""
    with ExitStack() as end:

        def make(*models):
            made = Virtual(*models)
            end.callback(made.close)
            return made

        yield make


@pytest.fixture
def opened(virtual):
    """A function that makes a drive alone on its bus: bus, motor, open and enabled, and plant."""

    def make(model):
        bus = virtual(model)
        motor = bus.motor(model)
        motor.open()
        motor.enable()
        return bus, motor, bus.plants[0]

    return make


@pytest.mark.parametrize("model", ("DM8009", "RS03", "CyberGear", "AK10-9", "mini-cheetah"))
def test_a_drive_that_did_not_answer_to_be_on_is_told_that_it_is_off(opened, model):
    """It counted as on, and the next commands were its torque."""
    _, motor, plant = opened(model)
    motor.disable()
    hear, motor.port.receive = motor.port.receive, lambda timeout: None
    patience, motor._latency = motor._latency, 0.0
    with pytest.raises(NoReply):
        motor._switch(on=True)
    motor.port.receive, motor._latency = hear, patience
    motor.write(5.0)
    motor.read()
    assert plant.torque == 0.0


@pytest.mark.parametrize("model", ("DM8009", "RS03", "CyberGear", "AK10-9", "mini-cheetah"))
def test_the_torque_that_is_commanded_alone_acts_and_is_read_back(virtual, model):
    bus = virtual(model)
    motor, plant = bus.motor(model), bus.plants[0]
    motor.open()
    plant.position = 0.7
    assert motor.read().motor_torque == pytest.approx(0.0, abs=0.05) and plant.torque == 0.0
    motor.write(5.0)
    assert motor.read().position == pytest.approx(1.0, abs=1e-3), "its zero is at -0.3 rad"
    assert plant.torque == 0.0, "it is off: what is sent is what switches it off"
    motor.enable()
    assert abs(plant.torque) < 0.02, "no count is zero"
    for torque in (5.0, -7.0, 0.0):
        motor.write(torque)
        motor.read()
        motor.write(torque)
        assert motor.read().motor_torque == pytest.approx(torque, abs=0.04)
        assert plant.torque == pytest.approx(torque, abs=0.02)
    motor.write(5.0)
    motor.close()
    assert plant.torque == 0.0 and not bus.drives[0].get("torque_enable")


def test_limits_are_known_before_a_drive_is_enabled(virtual):
    bus = virtual("DM8009")
    for limits, told in (
        (Limits(60.0, deflection=math.inf), "torque_limit = 60 N·m, expected at most 54 N·m"),
        (Limits(20.0, velocity=46.0), "velocity_limit = 46 rad/s, expected at most 45 rad/s, the range of"),
        (Limits(20.0, temperature=101.0), "temperature_limit = 101 °C, expected at most 100 °C"),
        (Limits(20.0, current=9.0, deflection=math.inf), "the device measures no current"),
    ):
        device = GuardedDevice(MotorNetft(bus.motor("DM8009"), None, limits, math.inf), limits, 100.0)
        with pytest.raises(ParameterError, match=told):
            device.open()
    assert bus.heard and not any(data[-1] == 0xFC for identity, _, data in bus.heard if identity == 1)


def test_a_drive_of_another_range_is_refused(virtual):
    bus = virtual("DM4310")
    with pytest.raises(DeviceError, match=r"range of velocity ±30, expected ±45 of DM8009"):
        bus.motor("DM8009").open()
    with pytest.raises(ParameterError, match="id = 16, expected 1 to 15"):
        bus.motor("DM8009", identity=16)


def test_a_drive_without_a_watchdog_on_a_bus_without_a_descriptor_is_refused(virtual):
    bus, limits = virtual("AK10-9"), Limits(9.0)
    device = GuardedDevice(MotorNetft(bus.motor("AK10-9"), None, limits, math.inf), limits, 100.0)
    with pytest.raises(ParameterError, match="allow_no_dead_host_protection"):
        device.open()
    assert bus.plants[0].torque == 0.0


def test_what_a_drive_keeps_from_before_is_zero_when_it_is_switched_on(opened):
    """The worst that a drive may do: to go on with its last command."""
    bus, motor, plant = opened("DM8009")
    motor.write(9.0)
    motor.read()
    bus.drives[0].put("torque_enable", 0)
    felt, told = [], plant.write
    plant.write = lambda torque: (felt.append(torque), told(torque))
    motor.enable()
    assert motor.read().motor_trouble == ""
    assert felt and max(map(abs, felt)) < 0.02


def test_two_drives_of_one_id_are_refused_and_noticed(virtual, opened):
    bus = virtual("AK10-9", "AK10-9")
    with pytest.raises(DeviceError, match="more answers than commands: two drives have this ID"):
        bus.motor("AK10-9").open()
    bus, motor, _ = opened("AK10-9")
    bus.drives.append(EmulatedDrive("AK10-9", Mass()))

    def noticed():
        motor.write(1.0)
        return "two drives" in motor.read().motor_trouble and motor.health()["bus_twice"] >= 3

    until(noticed)
    del bus.drives[0]


def test_several_drives_share_a_bus_and_do_not_hear_each_other(virtual):
    bus = virtual("RS03", "DM8009", "AK10-9")
    for place, drive in enumerate(bus.drives):
        drive.put("id", place + 1)
        bus.plants[place].position = 0.1 * place
    motors = [bus.motor(d, identity=k + 1) for k, d in enumerate(("RS03", "DM8009", "AK10-9"))]
    for motor in motors:
        motor.open()
        motor.enable()
    for place, motor in enumerate(motors):
        motor.write(1.0 + place)
    samples = [motor.read() for motor in motors]
    assert [s.position for s in samples] == pytest.approx([0.3, 0.4, 0.5], abs=1e-3)
    assert [s.motor_trouble for s in samples] == [""] * 3
    assert [plant.torque for plant in bus.plants] == pytest.approx([1.0, 2.0, 3.0], abs=0.02)


@pytest.mark.parametrize("model", ("AK10-9", "mini-cheetah", "RS03"))
def test_the_angle_goes_on_where_its_counts_begin_anew(opened, model):
    """Both ways over the end, three times round."""
    _, motor, plant = opened(model)
    first = motor.read().position
    walk = [0.9 * k for k in range(84)] + [75.0 - 0.9 * k for k in range(168)]
    for angle in walk:
        plant.position = angle
        assert motor.read().position - first == pytest.approx(angle, abs=2e-3)


@pytest.mark.parametrize("angle", (12.4, -13.0))
def test_the_end_of_an_angle_of_which_no_source_says_what_follows_is_a_fault(opened, angle):
    _, motor, plant = opened("DM8009")
    assert motor.read().motor_trouble == ""
    plant.position = angle
    assert motor.read().motor_trouble == "the angle is at the end of its range, ±12.5 rad"


def test_a_controller_that_is_bus_off_is_a_lost_port(opened):
    bus, motor, plant = opened("AK10-9")
    bus.tell(0x08, bytes(8), error=True)  # a bus error alone is counted
    until(lambda: motor.read() and motor.health()["bus_error_frames"] == 1)
    bus.tell(0x40, bytes(8), error=True)
    with pytest.raises(PortLost, match="bus-off"):
        until(lambda: motor.read() and False)
    motor.recover()
    assert plant.torque == 0.0 and not bus.drives[0].get("torque_enable")


@pytest.mark.parametrize(("code", "kind"), [(errno.ENOBUFS, NoReply), (errno.ENETDOWN, PortLost)])
def test_a_frame_that_does_not_go_out_is_a_lost_answer_or_a_lost_port(opened, monkeypatch, code, kind):
    """Without another node nobody acknowledges, and the queue is full; a bus that is off has no net."""
    _, motor, _ = opened("AK10-9")

    def send(self, message, timeout=None):
        raise can.CanOperationError("Failed to transmit", code)

    with monkeypatch.context() as broken:
        broken.setattr(can.interfaces.virtual.VirtualBus, "send", send)
        with pytest.raises(kind):
            motor.write(0.0)


def test_without_python_can_the_device_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "can", None)
    with pytest.raises(ParameterError, match=r"pip install 'rsea_ros\[can\]'"):
        MitMotor(CanConnection("can0", "AK80-9")).open()


@pytest.mark.parametrize("interface", ("socketcan", "slcan"))
def test_a_channel_that_is_not_there_is_a_lost_port(interface):
    with pytest.raises(PortLost, match="nowhere"):
        MitMotor(CanConnection("nowhere0", "AK80-9", interface=interface)).open()


def test_the_frames_for_a_supervisor_on_socketcan_are_the_kernels():
    port = MitMotor(CanConnection("can0", "CyberGear", 7)).port
    from rsea_ros.hardware.mit_can.frames import Frame

    assert port.wire(Frame(7, bytes(range(8)))) == b"\x07\0\0\0\x08\0\0\0" + bytes(range(8))
    assert port.wire(Frame(0x0400FD07, bytes(8), True))[:8] == b"\x07\xfd\x00\x84\x08\0\0\0"
    assert port.wire(Frame(0x020007FD, b"", True), whole=False) == b"\xfd\x07\x00\x82\x08\0\0\0"


@pytest.mark.parametrize("model", ("AK10-9", "mini-cheetah"))
def test_a_drive_without_a_state_that_is_off_is_noticed_by_its_torque(benches, model):
    """As after a power cycle; its answers go on."""
    bench = benches(model)
    well_behaved(bench)
    loop = Loop(bench, replace(limits_on(bench), effort=5.5))
    loop.guarded.enable()
    for _ in range(5):  # until the machine does not stall meanwhile
        assert loop.acts(10.0), loop.guarded.fault
        bench.ask("set", torque_enable=0)
        loop.until_fault(10.0)
        if loop.guarded.fault.cause == "effort":
            break
        assert is_stall(loop.guarded.fault.cause), loop.guarded.fault
        loop.guarded.clear()
    assert loop.guarded.fault.cause == "effort" and bench.torque() == (0, False)
    loop.guarded.clear()
    assert loop.acts(10.0)
    loop.close()


CODES = {"DM8009": (9, 10), "RS03": (1, 2)}


@pytest.mark.parametrize("loop", CODES, indirect=True)
def test_heat_and_an_error_that_the_drive_reports_are_faults(loop):
    loop.bench.ask("set", temperature=90)
    assert loop.until_fault(10.0) <= 3
    assert loop.guarded.fault.cause == "temperature"
    loop.bench.ask("set", temperature=32)
    loop.guarded.clear()
    for code, told in zip(CODES[loop.bench.model], ("under-voltage", "over-current"), strict=True):
        loop.bench.ask("alert", bits=code)
        assert loop.until_fault(10.0) <= 3 and str(loop.guarded.fault) == f"hardware_error: {told}"
        loop.guarded.reboot()
        assert loop.cycles(2, 10.0) == [10.0] * 2


def test_an_answer_that_is_late_is_not_taken_for_the_next(benches):
    """It has no number: the newest of those that come counts."""
    bench = benches("RS03")
    well_behaved(bench)
    for _ in range(5):  # until the machine does not stall meanwhile
        loop, begun = Loop(bench, latency=0.02), time.monotonic_ns()
        loop.guarded.enable()
        loop.cycles(5, 1.0)
        bench.ask("misbehave", delay=1.0, late=0.03)
        assert loop.guarded.cycle(1.0, 0.0) is None
        bench.ask("misbehave", delay=0.0)
        bench.ask("set", temperature=45)
        states = [loop.guarded.cycle(1.0, 0.0) for _ in range(4)]
        stalled = bench.stood_still(begun) > 5.0
        loop.close()
        bench.ask("set", temperature=32)
        if not stalled:
            break
    assert [state.temperature for state in states] == [45.0] * 4
    assert loop.device.health()["bus_lost"] == 1 and loop.guarded.fault is None


def test_a_file_of_ranges_drives_a_motor(benches, tmp_path):
    bench = benches("AK10-9")
    well_behaved(bench)
    path = tmp_path / "mine.yaml"
    path.write_text("family: cubemars\nposition: 12.5\nvelocity: 50\ntorque: 65\n")
    motor = MitMotor(CanConnection(bench.port, str(path), interface="slcan", latency=0.03, watchdog=0.5))
    guarded = GuardedDevice(MotorNetft(motor, None, limits_on(bench), math.inf), limits_on(bench), 1 / PERIOD)
    guarded.open()
    assert guarded.device.health()["motor"] == "cubemars mine" and guarded.device.rating.torque == 65.0
    guarded.device.close()
    assert device_on(bench).protection.kind == "none", "before it is open"
