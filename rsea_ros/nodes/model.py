"""model: torques on both ends by sample, and whether the actuator is a pure torque source just now."""

import math
import threading
from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import Bool, JointState, efforts_message
from rsea_ros.model.observer import Noise, Observer, TorqueEstimate
from rsea_ros.model.observer.assemble import Consistency, consistency
from rsea_ros.model.pure_torque_error import PURE, ErrorFlag, ErrorSettings
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.model.transfer import pure_torque_bandwidth
from rsea_ros.nodes._commands import WATCHDOG
from rsea_ros.nodes._cycle import REALTIME, SECOND, keep_time
from rsea_ros.nodes._health import OK, WARN, Health, NodeHealth
from rsea_ros.nodes._joint_inputs import (
    IDENTIFICATION,
    InputSettings,
    ModelInputs,
    noise_from,
    stopped_sensors,
)
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter, let_change, live
from rsea_ros.nodes._qos import COMMAND, LATCHED, RECORD_RELIABLE, await_arrival
from rsea_ros.nodes._run import Component, Program
from rsea_ros.nodes._tap import raw_writer
from rsea_ros.nodes._waiter import Waiter

EVERY = 128
"""Estimates between two looks at their noise: 0.1 ms each, outside of the slowest hundredth of samples."""

COMPARED = 32
"""Estimates between two comparisons of the sensors: a flag that is up for a second too long is wrong."""
CHANGED = 0.1
"""Part by which period or doubt of the estimates must have changed before their noise is worked out again."""


UNMOVED = "joint_states repeats one value while torque_command moves: stopped, or the drive is off"


class ModelHealth:
    """Assesses the node once a second, and passes the noise of the estimates to the band.

    contradictions: sensors that differ from model and others by more than what the flag tolerates, in words.
    """

    def __init__(
        self, rig: Rig, noise: Noise, observer: Observer, band: TorqueBand, error: ErrorFlag,
        inputs: ModelInputs,
    ) -> None:  # fmt: skip
        self._observer, self._torque_band, self._error, self._inputs = observer, band, error, inputs
        j_sc = rig["chassis.inertia"]
        sprung = j_sc > 0.0 and not rig.rigid_spring
        self._eq_7 = pure_torque_bandwidth(rig["spring.stiffness"], j_sc) if sprung else math.inf
        self._calibrated = (math.nan, math.nan)
        self._errors = {"ft": noise.ft, "position": noise.position * rig["spring.stiffness"]}
        self.contradictions: list[str] = []
        self._scores = observer.scores()
        self.estimate: TorqueEstimate | None = None
        self.count = 0

    def tell(self, estimate: TorqueEstimate) -> None:
        """Process the newest estimate; the band learns the noise once that has settled or changed."""
        self.estimate = estimate
        self.count += 1
        if self.count % EVERY == 0:
            self._calibrate(estimate.sigma_distal)
        if self.count % COMPARED == 0:
            now = self._observer.scores()
            change, self._scores = now - self._scores, now
            self.contradictions = self._contradictions(consistency(change))

    def report(self) -> NodeHealth:
        """Return the report."""
        if self.estimate is None:
            return NodeHealth(
                WARN, "no measurement yet, expected joint_states and ft", {"bandwidth_hz": self._edge()}
            )
        tests = self._observer.consistency()
        sensors = self._inputs.stopped
        stopped = [f"{topic} repeats one value: the sensor has stopped" for topic in sensors.frozen]
        if sensors.unmoved and not stopped:
            stopped = [UNMOVED]
        doubts = (
            f"model inconsistent with {name}: innovations {t.ratio:.2f} times theirs (limit {t.limit:.2f})"
            for name, t in tests.items()
            if t.broken
        )
        troubles = [*stopped, *self.contradictions, *self._silence(), *doubts]
        summary = "; ".join(troubles) or self._error.verdict
        values = self._values(self.estimate)
        for name, t in tests.items():
            values |= {f"{name}.innovation": f"{t.ratio:.3f}", f"{name}.innovation_limit": f"{t.limit:.3f}"}
            values[f"{name}.innovation_mean"] = f"{t.mean:.3g}"
        return NodeHealth(WARN if troubles else OK, summary, values)

    def _contradictions(self, tests: Mapping[str, Consistency]) -> list[str]:
        """Return the channels whose innovations, N m RMS, are more than the tolerated part of the torque.

        So large is no error of a model: a sensor repeats an old value under its own noise, or is wrong.
        A torque too small beside the observer's doubt of it is not judged.
        """
        if math.isnan(self._error.share):
            return []
        limit = self._error.settings.tolerance * self._error.torque
        off = {name: tests[name].ratio * self._errors[name] for name in self._errors.keys() & tests.keys()}
        return [
            f"{name} differs from model and other sensors by {rms:.3g} N·m RMS, limit {limit:.3g} N·m"
            for name, rms in sorted(off.items())
            if rms > limit and tests[name].broken
        ]

    def _calibrate(self, sigma: float) -> None:
        now = (self._inputs.period, sigma)
        alike = all(abs(a - b) <= CHANGED * b for a, b in zip(now, self._calibrated, strict=True))
        if not (alike or math.isnan(now[0])):
            self._torque_band.calibrate(self._observer.error_model(now[0]), now[0])
            self._calibrated = now

    def _edge(self) -> str:
        return f"{self._torque_band.edge:.2f}"

    def _silence(self) -> list[str]:
        if not self._inputs.ft_silent or self.estimate is None:
            return []
        doubt = f"sigma of the distal torque {self.estimate.sigma_distal:.3g} N·m"
        return [f"no ft for {self._inputs.ft_age:.2f} s: estimated without it, {doubt}"]

    def _values(self, estimate: TorqueEstimate) -> dict[str, object]:
        reading = self._torque_band.occupied()
        is_known = math.isfinite(reading.hz)
        gain, phase = self._torque_band.error_at(reading.hz) if is_known else (math.nan, math.nan)
        return {
            "verdict": self._error.verdict,
            "tolerance": f"{self._error.settings.tolerance:g}",
            "error_share": f"{self._error.share:.4f}",
            "error_edge_hz": f"{self._error.edge.hz:.2f}",
            "error_edge_low_hz": f"{self._error.edge.low:.2f}",
            "error_edge_high_hz": f"{self._error.edge.high:.2f}",
            "bandwidth_hz": self._edge(),
            "eq_7_hz": f"{self._eq_7:.2f}",
            "occupied_hz": f"{reading.hz:.2f}",
            "share_above": f"{reading.share_above:.4f}",
            "gain_error_db": f"{gain:.2f}",
            "phase_error_deg": f"{phase:.1f}",
            "sigma_distal": f"{estimate.sigma_distal:.4g}",
            "sigma_proximal": f"{estimate.sigma_proximal:.4g}",
            "disturbance": f"{estimate.disturbance:.4g}",
            "sigma_disturbance": f"{estimate.sigma_disturbance:.4g}",
            "ft_age_ms": f"{1e3 * self._inputs.ft_age:.1f}",
            "late_samples": self._observer.late,
            "too_late_samples": self._observer.refused,
            "refused_messages": self._inputs.refused,
            "unstamped_commands": self._inputs.unstamped,
            "restarts": self._observer.restarts,
        }


NAME = "pure_torque"


class Flags:
    """`pure_torque` (Bool) and `pure_torque_stamped` (JointState: effort[0] is 1 or 0), both latched."""

    def __init__(self, node: Node) -> None:
        self._bare = node.create_publisher(Bool, NAME, LATCHED)
        self._stamped = node.create_publisher(JointState, f"{NAME}_stamped", LATCHED)
        self._up, self._stamp = False, 0
        self._publish()

    def show(self, stamp: int, up: bool) -> None:
        """Publish the flag from a sample (its stamp in ns) on, if it has changed."""
        self._stamp = stamp
        if up != self._up:
            self._up = up
            self._publish()

    def lower(self) -> None:
        """Lower the flag, and wait until all subscribers have it."""
        self._up = False
        self._publish()
        for publisher in (self._bare, self._stamped):
            await_arrival(publisher)

    def _publish(self) -> None:
        self._bare.publish(Bool(data=self._up))
        self._stamped.publish(efforts_message(self._stamp, {NAME: float(self._up)}))


OF_BAND = ("tolerance_db", "tolerance_deg", "quiet")
OF_ERROR = ("tolerance", "error_window", "error_hysteresis", "quiet")
"""Parameters of the band and of the flag, which may change while the node runs: the flag begins anew then."""
TABLE = live((
    NodeParameter(
        "rig", "paper_high_impedance", "the model: a name of config/rigs, or a file such as model.yaml"
    ),
    IDENTIFICATION,
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
), {*OF_BAND, *OF_ERROR})  # fmt: skip
NAMES = ("distal", "proximal", "disturbance")
TICK = 0.02
"""s between looks at what has come without ft."""


class ModelNode(Program):
    """Wakes at each ft and processes the messages that came with it; while ft is silent, every 20 ms."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._rig = rig = load_rig(values["rig"])
        self._noise = noise = noise_from(rig, values["identification"])
        self._observer = Observer(rig, noise, hold=WATCHDOG / SECOND, duration=values["duration"])
        qos = RECORD_RELIABLE if values["reliable"] else COMMAND
        self._estimates = node.create_publisher(JointState, "torque_estimate", qos)
        self._writer = raw_writer(efforts_message(0, dict.fromkeys(NAMES, 0.0)), "effort")
        self._flags, self._has_ft = Flags(node), "ft" in rig.sensors
        read = InputSettings(**{n: values[n] for n in ("ft_timeout", "axis", "reliable", "joint")})
        self._stopped = stopped_sensors(rig, noise)
        self._inputs = ModelInputs(node, self._observer, self._stopped, read)
        self._lock, self._values = threading.Lock(), values
        self._change({})
        let_change(node, TABLE, self._change)
        self._health = Health(node, self._report, values["rig"])
        self._waiter = Waiter(node, [self._inputs.ft.subscription], self._work, TICK)
        keep_time(node, self._waiter, values)
        node.get_logger().info(f"rig {rig.name}: pure torque up to {self._error.edge.hz:.1f} Hz")

    def _change(self, new: dict[str, Any]) -> None:
        """Make band, flag and assessment for new values; the observer goes on."""
        values = {**self._values, **new}
        band = TorqueBand(self._rig, *(values[name] for name in OF_BAND))
        error = ErrorFlag(self._rig, ErrorSettings(*(values[name] for name in OF_ERROR)))
        assess = ModelHealth(self._rig, self._noise, self._observer, band, error, self._inputs)
        with self._lock:
            self._band, self._error, self._assess, self._values = band, error, assess, values

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
        return not self._waiter.is_running()

    def close(self) -> None:
        """Leave nothing behind: the flag of a node that is gone is down, and its subscribers know."""
        self._waiter.stop()
        self._flags.lower()


NODE = Component("model", TABLE, ModelNode, patience=8.0)  # ros2 launch kills after 10 s
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
