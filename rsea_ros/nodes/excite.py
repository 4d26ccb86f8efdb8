"""excite: plays an excitation as torque commands, and ends with zeros whatever happens."""

from __future__ import annotations

import math
import sys
import time
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import JointState, stamp_of, torque_command_message
from rsea_ros.identification.excitation import KINDS, Settings, check_limits, excitation
from rsea_ros.nodes._cycle import SECOND, Cycle
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, Report
from rsea_ros.nodes._parameters import JOINT, Parameter
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, await_arrival
from rsea_ros.nodes._run import run_node

TABLE = (
    Parameter("kind", "chirp", "excitation", choices=tuple(KINDS)),
    Parameter(
        "amplitude", 20.0, "peak of chirp and steps, rms of multisine and white noise", "N m", 0.0, 1e4
    ),
    Parameter("noise", 10.0, "standard deviation of the noise on top of the chirp", "N m", 0.0, 1e4),
    Parameter("duration", 160.0, "length without the ramps of a multisine", "s", 0.1, 1e5),
    Parameter("rate", 280.0, "commands a second", "Hz", 50.0, 1000.0),
    Parameter("low", 0.01, "lowest frequency", "Hz", 1e-4, 500.0),
    Parameter("high", 140.0, "highest frequency, kept below 0.475 of the rate", "Hz", 1e-3, 500.0),
    Parameter("period", 10.0, "period of multisine and steps", "s", 0.01, 1e4),
    Parameter("seed", 0, "seed of noise and phases", "", 0, 1_000_000_000),
    Parameter(
        "limit", 68.0, "largest torque; the whole excitation is checked before it starts", "N m", 0.0, 1e4
    ),
    Parameter("ramp", 0.5, "raised cosine at either end", "s", 0.0, 100.0),
    Parameter("lead", 0.1, "how long before it takes effect a command is published", "s", 0.0, 0.2),
    Parameter("subscribers", 1, "subscriptions of torque_command to wait for", "", 1, 100),
    JOINT,
)
SETTLE = SECOND // 2
CLOSING_ZEROS = 3
MARGIN = SECOND // 100
"""A command that has less than this left until it takes effect is left out: its stamp would not be true."""


class Excite:
    """Commands on the grid of the measurements' stamps, each published `lead` before it takes effect."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        names = ("rate", "duration", "amplitude", "noise", "low", "high", "period", "seed")
        self._rate: float = values["rate"]
        self._command = excitation(values["kind"], Settings(**{n: values[n] for n in names}), values["ramp"])
        check_limits(self._command, values["limit"], self._rate)
        self._node, self._lead = node, round(values["lead"] * SECOND)
        self._wanted = values["subscribers"]
        self._next, self._left_out, self._stamp = 0, 0, 0
        self._joint = values["joint"]
        self._publisher = node.create_publisher(JointState, "torque_command", COMMAND)
        self._measurements = node.create_subscription(JointState, "joint_states", self._begin, MEASUREMENT)
        self._cycle = Cycle(self._rate, self._step, catch_up=True)
        self._started = False
        self._health = Health(node, self._report)
        node.create_timer(1.0, self._tell, clock=STEADY)

    def _begin(self, message: JointState) -> None:
        """Start at a whole number of periods after a measurement, once everybody listens."""
        if self._started or self._publisher.get_subscription_count() < self._wanted:
            return
        self._started = True
        self._cycle.start(self._first(stamp_of(message.header.stamp)) - self._lead)
        self._node.destroy_subscription(self._measurements)

    def _first(self, measured: int) -> int:
        """Return when the first command takes effect, ns."""
        earliest = time.time_ns() + self._lead + SETTLE
        periods = math.ceil((earliest - measured) * self._rate / SECOND)
        first: int = measured + round(periods * SECOND / self._rate)
        return first

    def _step(self, now: int) -> None:
        """Publish the next command, or leave it out when this thread was held up for too long."""
        k, self._next = self._next, self._next + 1
        torque = self._command[k] if k < len(self._command) else 0.0
        self._stamp = now + self._lead
        if self._lead and self._stamp - time.time_ns() < min(MARGIN, self._lead // 2):
            self._left_out += 1
        else:
            self._publisher.publish(torque_command_message(self._stamp, torque, self._joint))

    def finished(self) -> bool:
        """Tell whether the whole excitation is out."""
        if self._started:
            self._cycle.running()
        return self._next >= len(self._command)

    def conclude(self) -> None:
        """Leave nothing to do: `close` commands the zeros."""

    def close(self) -> None:
        """Command zero torque after the last command, and wait until that has arrived."""
        self._cycle.stop()
        last = max(self._stamp, time.time_ns())
        for k in range(1, CLOSING_ZEROS + 1 if self._started else 1):
            stamp = last + round(k * SECOND / self._rate)
            self._publisher.publish(torque_command_message(stamp, 0.0, self._joint))
        await_arrival(self._publisher)
        self._node.get_logger().info(f"torque zero after {self._next} commands, {self._left_out} left out")

    def _tell(self) -> None:
        if self._started:
            share = min(1.0, self._next / len(self._command))
            self._node.get_logger().info(f"{share:.0%} of {len(self._command) / self._rate:.1f} s")
        else:
            count = self._publisher.get_subscription_count()
            wanted = (
                f"{count} of {self._wanted} subscriptions of torque_command and a message on joint_states"
            )
            self._node.get_logger().info(f"waiting: {wanted}", throttle_duration_sec=5.0)

    def _report(self) -> Report:
        values = {"commands": self._next, "left_out": self._left_out}
        if self._started:
            values |= self._cycle.timing().values()  # type: ignore[arg-type]
        level = WARN if self._left_out else OK
        return Report(level, "running" if self._started else "waiting for a measurement", values)


def main() -> int:
    """Run the node."""
    return run_node("excite", TABLE, Excite, endless=False)


if __name__ == "__main__":
    sys.exit(main())
