"""The driver's loop without ROS, at absolute deadlines, for measurements of what goes over the wire."""

import time
from collections.abc import Callable

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.bus_motor import BusMotor
from rsea_ros.hardware.device import State
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.mit_can.motor import CanConnection, MitMotor
from rsea_ros.hardware.motor_netft import MotorNetft
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._devices import limits_of
from rsea_ros.nodes.driver import TABLE

RATE, STIFFNESS = 280.0, 1530.456


def graded(told: str, good: bool) -> str:
    """Return what was measured behind whether it is as required."""
    return f"{'ok  ' if good else 'NOT '} {told}"


class Loop:
    """A device on a bench and its limits, 280 cycles a second; by default those of config/nodes.

    supervisor: socket of its service; empty: a child. spent: time in each cycle, s.
    """

    def __init__(self, bench: RemoteBench, limits: Limits | None = None, supervisor: str = "") -> None:
        place = {p.name: p.default for p in TABLE} | bench.parameters()
        limits, model = limits or limits_of(place), str(place["can_model"])
        self.bench = bench
        motor: BusMotor = (
            MitMotor(CanConnection(bench.port, model, interface="slcan", latency=usual_latency(RATE, 1),
                                   supervisor=supervisor))
            if model else
            Motor(MotorConnection(bench.port, 4_000_000, latency=usual_latency(RATE), supervisor=supervisor))
        )  # fmt: skip
        sensor = SensorConnection("127.0.0.1", bench.ft_port, bench.page_port, 0.01)
        self.device = MotorNetft(motor, sensor, limits, STIFFNESS)
        self.guarded = GuardedDevice(self.device, limits, RATE)
        self.guarded.open()
        self.guarded.enable()
        self._period, self._due = 1e9 / RATE, float(time.monotonic_ns())
        self.states: list[State] = []
        self.spent: list[float] = []

    def cycle(self, age: float = 0.0) -> None:
        """Wait for the next deadline and do one cycle under 10 N·m. age: of the command, s."""
        now = time.monotonic_ns()
        self._due = max(self._due + self._period, now - self._period)
        time.sleep(max(0.0, self._due - now) / 1e9)
        begin = time.monotonic_ns()
        state = self.guarded.cycle(10.0, age)
        self.spent.append((time.monotonic_ns() - begin) / 1e9)
        if state is not None:
            self.states.append(state)

    def cycles(self, most: int, until: Callable[[], object] = lambda: False, age: float = 0.0) -> int:
        """Return after how many cycles a condition holds. age: of a command that ceased, s; else 0."""
        done = 0
        while done < most and not until():
            self.cycle(age and age + done / RATE)
            done += 1
        return done

    def is_latched(self) -> bool:
        """Return whether a fault is latched."""
        return self.guarded.fault is not None

    def call(self, service: str) -> str:
        """Call a service; return `done`, or its error."""
        try:
            getattr(self.guarded, service)()
        except DeviceError as error:
            return f"{error}"
        return "done"

    def drive(self) -> None:
        """Run until torque acts; clear what a stall of the machine has latched, also in a drive on CAN."""
        self.cycles(20)
        while self.is_latched():
            if self.call("clear") != "done":
                self.call("reboot")
            self.cycles(20)
