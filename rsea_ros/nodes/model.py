"""model: torques on both ends by sample, and whether the actuator is a pure torque source just now."""

import sys
import threading
from typing import Any

from rclpy.node import Node
from rclpy.serialization import serialize_message

from msg_adapters.cdr import RawWriter
from msg_adapters.ros import JointState, efforts_message
from msg_adapters.topic_map import TYPES
from rsea_ros.model.observer import Observer
from rsea_ros.model.pure_torque_error import PURE, ErrorFlag, ErrorSettings
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes._commands import WATCHDOG
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._health import Health, NodeHealth
from rsea_ros.nodes._health_inputs import noise_from
from rsea_ros.nodes._model_health import Flags, ModelHealth
from rsea_ros.nodes._model_inputs import InputSettings, ModelInputs, stopped_sensors
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter
from rsea_ros.nodes._qos import COMMAND, RECORD_RELIABLE
from rsea_ros.nodes._realtime import REALTIME, keep_time
from rsea_ros.nodes._run import Program, run_node
from rsea_ros.nodes._waiter import Waiter

TABLE = (
    NodeParameter(
        "rig", "paper_high_impedance", "the model: a name of config/rigs, or a file such as model.yaml"
    ),
    NodeParameter(
        "identification", "", "identification.json whose measured noise counts; empty: that of the rig"
    ),
    AXIS,
    NodeParameter(
        "duration", 60.0, "time over which drifts of the model come to their full size", "s", 1.0, 1e6
    ),
    NodeParameter(
        "ft_timeout", 0.02, "time without ft after which joint_states make the estimates", "s", 1e-3, 1.0
    ),
    NodeParameter(
        "reliable", False, "lose nothing, in the order of stamps; needs reliable publishers, as replay's are"
    ),
    NodeParameter("tolerance", 0.3, "of |T_p - T_d| over |T_d|: up to it the torque is pure", "", 0.01, 1.0),
    NodeParameter("error_window", 0.5, "over which that is measured, RMS", "s", 0.01, 2.0),
    NodeParameter("error_hysteresis", 0.15, "part of that tolerance, either way", "", 0.0, 0.5),
    NodeParameter("tolerance_db", 3.0, "of |T_d/T_p| in the band of pure torque", "dB", 0.01, 40.0),
    NodeParameter("tolerance_deg", 30.0, "of its phase; 90 leaves that out of account", "deg", 0.1, 90.0),
    NodeParameter("quiet", 0.2, "time below the noise floor that is no torque", "s", 0.0, 100.0),
    JOINT,
    *REALTIME,
)
NAMES = ("distal", "proximal", "disturbance")
TICK = 0.02
"""s between looks at what has come without ft."""


class ModelNode(Program):
    """Wakes at each ft and processes the messages that came with it; while ft is silent, every 20 ms."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        rig = load_rig(values["rig"])
        noise = noise_from(rig, values["identification"])
        observer = Observer(rig, noise, hold=WATCHDOG / SECOND, duration=values["duration"])
        self._band = TorqueBand(rig, *(values[n] for n in ("tolerance_db", "tolerance_deg", "quiet")))
        asked = (values[n] for n in ("tolerance", "error_window", "error_hysteresis", "quiet"))
        self._error = ErrorFlag(rig, ErrorSettings(*asked))
        qos = RECORD_RELIABLE if values["reliable"] else COMMAND
        self._estimates = node.create_publisher(JointState, "torque_estimate", qos)
        template = serialize_message(efforts_message(0, dict.fromkeys(NAMES, 0.0)))
        self._writer = RawWriter(template, TYPES["joint_states"], "effort")
        self._flags, self._has_ft = Flags(node), "ft" in rig.sensors
        read = InputSettings(**{n: values[n] for n in ("ft_timeout", "axis", "reliable", "joint")})
        self._stopped = stopped_sensors(rig, noise)
        self._inputs = ModelInputs(node, observer, self._stopped, read)
        self._assess = ModelHealth(rig, noise, observer, self._band, self._error, self._inputs)
        self._lock = threading.Lock()
        self._health = Health(node, self._report, values["rig"])
        self._waiter = Waiter(node, [self._inputs.ft.subscription], self._work, TICK)
        keep_time(node, self._waiter, values)
        node.get_logger().info(f"rig {rig.name}: pure torque up to {self._error.edge.hz:.1f} Hz")

    def _work(self) -> None:
        """Publish an estimate for each sample that came, and the flag when it changes."""
        with self._lock:
            for stamp, estimate in self._inputs.take():
                self._estimates.publish(self._writer.write(stamp, estimate))
                t = self._inputs.seconds(stamp)
                heard = self._band.take(t, estimate)
                pure = self._error.take(t, estimate, heard=heard) == PURE
                silent = self._has_ft and self._inputs.ft_silent  # nobody knows the torque then
                stopped = self._stopped.frozen or self._stopped.unmoved
                doubted = stopped or silent or self._assess.contradictions
                self._flags.show(stamp, pure and not doubted)
                self._assess.tell(estimate)

    def _report(self) -> NodeHealth:
        with self._lock:
            return self._assess.report()

    def is_finished(self) -> bool:
        """Run until stopped."""
        return not self._waiter.is_running()

    def close(self) -> None:
        """Leave nothing behind: the flag of a node that is gone is down, and its subscribers know."""
        self._waiter.stop()
        self._flags.lower()


def main() -> int:
    """Run the node."""
    return run_node("model", TABLE, ModelNode)


if __name__ == "__main__":
    sys.exit(main())
