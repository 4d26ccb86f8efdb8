"""The driver's loop without ROS, at absolute deadlines, for measurements of what goes over the wire."""

from __future__ import annotations

import time
from collections.abc import Callable

from rsea_ros.hardware.device import State
from rsea_ros.hardware.dynamixel.control_tables import MotorConnection, usual_latency
from rsea_ros.hardware.dynamixel.motor import Motor
from rsea_ros.hardware.dynamixel_netft import DynamixelNetft
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.netft.sensor import SensorConnection
from rsea_ros.hardware.peer.remote import RemoteBench

STIFFNESS = 1530.456


class Loop:
    """A device on a bench and its limits, `rate` cycles a second. spent: time in each cycle, s."""

    def __init__(self, bench: RemoteBench, rate: float, *, lost_cycles: int = 3, ft_timeout: float = 0.01,
                 latency: float = 0.0, limits: Limits | None = None) -> None:  # fmt: skip
        limits = limits or Limits(68.0, lost_cycles=lost_cycles)
        self.bench = bench
        self.device = DynamixelNetft(
            Motor(MotorConnection(bench.port, 4_000_000, latency=latency or usual_latency(rate))),
            SensorConnection("127.0.0.1", bench.ft_port, bench.page_port, ft_timeout), limits, STIFFNESS,
        )  # fmt: skip
        self.guarded = GuardedDevice(self.device, limits, rate)
        self.guarded.open()
        self.guarded.enable()
        self._period, self._due = 1e9 / rate, float(time.monotonic_ns())
        self.states: list[State] = []
        self.spent: list[float] = []

    def cycle(self, torque: float, age: float = 0.0) -> State | None:
        """Wait for the next deadline and do one cycle. age: of the command, s."""
        now = time.monotonic_ns()
        self._due = max(self._due + self._period, now - self._period)
        time.sleep(max(0.0, self._due - now) / 1e9)
        begin = time.monotonic_ns()
        state = self.guarded.cycle(torque, age)
        self.spent.append((time.monotonic_ns() - begin) / 1e9)
        if state is not None:
            self.states.append(state)
        return state

    def run(self, seconds: float, torque: Callable[[int], float]) -> None:
        """Run for some seconds; torque: N m, by the number of the cycle."""
        for k in range(round(seconds * 1e9 / self._period)):
            self.cycle(torque(k))
