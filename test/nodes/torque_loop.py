"""Topics of plant and controller as a test sees them, and sines of the desired torque."""

from __future__ import annotations

import time

import numpy as np

from msg_adapters.ros import (
    DiagnosticArray,
    DiagnosticStatus,
    JointState,
    WrenchStamped,
    stamp_of,
    torque_command_message,
)
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT, RECORD_RELIABLE
from test.nodes.on_wire import newest_status

RATE = 280.0
GAINS = {"k_p": 0.163, "k_d": 0.003528, "k_i": 1.173, "q_frequency": 8.679, "k_w": 39.9}
"""Of the synthesis, which takes half a second."""
PERIOD = SECOND / RATE
LEAD = 0.2
"""s by which desired torques are sent ahead."""
RISE = 0.25
"""s, in which a sine grows to its amplitude."""
STALLS = "commands more than 1 sample late", "no usable measurement"
"""Of the faults that a machine that stalls makes the controller latch."""
SETTLED = 1.0
"""s after its begin from which on it counts."""


class Loop:
    """Topics of plant and controller in a namespace as seen from outside. stalls: faults that it clears.

    A listener that the machine holds up for a second hears the few pulses of a command none the less.
    """

    def __init__(self, listener, namespace="/rsea", stalls=STALLS):
        self.listener, self._namespace, self._stalls = listener, namespace, stalls
        self.states = listener.hear(JointState, f"{namespace}/joint_states", MEASUREMENT)
        self.wrenches = listener.hear(WrenchStamped, f"{namespace}/ft", MEASUREMENT)
        self.commands = listener.hear(JointState, f"{namespace}/torque_command", RECORD_RELIABLE)
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self._desired = listener.node.create_publisher(JointState, f"{namespace}/desired_torque", COMMAND)

    def ready(self):
        """Wait until the controller commands and all is heard: each topic is discovered at its own time."""
        self.listener.until(lambda: self._desired.get_subscription_count() and len(self.commands) > 100)
        self.listener.until(lambda: self.states and self.wrenches)

    def mend(self):
        """Clear what a machine that stalls has latched."""
        if any(stall in self.values()[""] for stall in self._stalls):
            self.listener.call(f"{self._namespace}/controller/clear_fault")

    def sine(self, amplitude, hz, seconds, during=lambda t: None):
        """Publish a sine on the grid of the measurements, ahead of time; return the error, by period.

        during: called at each sample with the time (s) since its begin that measurements have reached.
        """
        self.mend()
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

    def desire(self, torque):
        """Publish a desired torque of now."""
        self._desired.publish(torque_command_message(time.time_ns(), torque))

    def hold(self, torque, condition):
        """Publish a constant torque until a condition holds."""
        self.listener.until(condition, lambda: self.desire(torque), self.mend)

    def values(self):
        """Key and value of the controller's newest status."""
        newest = newest_status(self.health, f"{self._namespace}/controller") or DiagnosticStatus()
        return {pair.key: pair.value for pair in newest.values} | {"": newest.message}
