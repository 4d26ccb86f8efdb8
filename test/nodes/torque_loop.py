"""Topics of plant and controller as a test sees them, and sines of the desired torque."""

from __future__ import annotations

import time

import numpy as np

from msg_adapters.ros import (
    DiagnosticArray,
    JointState,
    WrenchStamped,
    stamp_of,
    torque_command_message,
)
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

RATE = 280.0
PERIOD = SECOND / RATE
LEAD = 0.2
"""s by which desired torques are sent ahead."""
RISE = 0.25
"""s, in which a sine grows to its amplitude."""
SETTLED = 1.0
"""s after its begin from which on it counts."""


class Loop:
    """Topics of plant and controller as seen from outside."""

    def __init__(self, listener):
        self.listener = listener
        self.states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
        self.wrenches = listener.hear(WrenchStamped, "/rsea/ft", MEASUREMENT)
        self.commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self._desired = listener.node.create_publisher(JointState, "/rsea/desired_torque", COMMAND)

    def ready(self):
        """Wait until the controller commands and all is heard: each topic is discovered at its own time."""
        self.listener.until(lambda: self._desired.get_subscription_count() and len(self.commands) > 100)
        self.listener.until(lambda: self.states and self.wrenches)

    def sine(self, amplitude, hz, seconds, during=lambda t: None):
        """Publish a sine on the grid of the measurements, ahead of time; return the error, by period.

        during: called at each sample with the time (s) since its begin that measurements have reached.
        """
        start = stamp_of(self.states[-1].header.stamp) + round(0.3 * RATE) * PERIOD
        wanted = lambda t: amplitude * np.minimum(1.0, t / RISE) * np.sin(2 * np.pi * hz * t)  # noqa: E731
        for k in range(round(seconds * RATE)):
            stamp = round(start + k * PERIOD)
            self.listener.until(lambda stamp=stamp: stamp < time.time_ns() + LEAD * SECOND)
            self._desired.publish(torque_command_message(stamp, wanted(k / RATE)))
            during((stamp_of(self.wrenches[-1].header.stamp) - start) / SECOND)
        self.listener.until(lambda: stamp_of(self.wrenches[-1].header.stamp) > start + seconds * SECOND)
        read = np.array([(stamp_of(m.header.stamp), m.wrench.torque.z) for m in self.wrenches])
        t = (read[:, 0] - start) / SECOND
        inside = (t > SETTLED) & (t < seconds)
        error, period = (read[:, 1] - wanted(t))[inside], np.floor(t[inside] * hz)
        return [
            np.sqrt(np.mean(error[period == p] ** 2)) / amplitude * np.sqrt(2.0) for p in np.unique(period)
        ]

    def hold(self, torque, condition):
        """Publish a constant torque until a condition holds."""

        def done():
            self._desired.publish(torque_command_message(time.time_ns(), torque))
            return condition()

        self.listener.until(done)

    def values(self):
        """Key and value of the controller's newest status."""
        mine = [m for m in self.health if m.status[0].name.endswith("controller")]
        return {pair.key: pair.value for pair in mine[-1].status[0].values} | {"": mine[-1].status[0].message}
