"""watch: the live view, a page in a browser. It listens, and commands only where it was started to.

The page requests the newest samples of each topic. All subscriptions to measurements are best effort and
hold a bounded queue: a publisher neither waits for this node nor repeats anything for it.
"""

import math
import sys
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient

from rsea_extras.watch.command import Bounds, Commander
from rsea_extras.watch.desk import Runs
from rsea_extras.watch.server import Server
from rsea_ros import Rig, load_rig
from rsea_ros.extension import node as ros
from rsea_ros.extension.rigs import END_NAMES

SILENT, GONE = 3.0, 30.0
"""s after which a node's health is old, and after which it is forgotten."""
MOST_NODES = 40
STALE = 3
"""Level of a health that is old, as diagnostics number it."""
Rows = dict[str, list[tuple[float, float]]]


class WatchSource:
    """Samples by channel, flag and health. axis, joint: as for every node.

    newest: last stamp of joint_states, ns.
    """

    def __init__(self, node: Node, rig: Rig, axis: str, joint: str) -> None:
        self._namespace = node.get_namespace().rstrip("/") + "/"
        self._sign, along = ros.sign_and_index(axis)
        self._stiffness = math.nan if rig.rigid_spring else rig["spring.stiffness"]
        self._angle_is_deflection = rig.clamped == set(END_NAMES)
        self.flag: bool | None = None
        self.newest, self._epoch = 0, 0
        self._health: dict[str, tuple[float, Mapping[str, Any]]] = {}
        self._counted = time.monotonic()
        self.bench = f"{self._namespace.strip('/')} · {rig.name}"
        effort = ("effort", 0)
        self._boxes = {
            topic: ros.Mailbox(
                node, topic, ros.MessageFields(kind, tuple(fields), name, most), ros.MEASUREMENT, lambda: None
            )
            for topic, kind, name, most, *fields in (
                ("joint_states", ros.JOINT_STATE, joint, 1, ("position", 0), effort),
                ("ft", ros.WRENCH, "", 1, ("wrench", along)),
                ("torque_estimate", ros.JOINT_STATE, "", 3, effort, ("effort", 1), ("effort", 2)),
                ("torque_command", ros.JOINT_STATE, joint, 1, effort),
            )
        }
        self._counts = dict.fromkeys(self._boxes, 0)
        node.create_subscription(ros.Bool, "pure_torque", self._on_flag, ros.LATCHED)
        node.create_subscription(ros.DiagnosticArray, "/diagnostics", self._on_health, ros.MEASUREMENT)

    def take(self) -> Mapping[str, Sequence[tuple[float, float]]]:
        """Return the samples since the last call: s since the first stamp, SI."""
        rows: Rows = {}
        for stamp, (angle, effort) in self._of("joint_states"):
            self.newest = max(self.newest, stamp)
            _put(rows, self._seconds(stamp), motor=effort)
            if self._angle_is_deflection:
                _put(rows, self._seconds(stamp), deflection=angle)
        for stamp, (torque,) in self._of("ft"):
            t, torque = self._seconds(stamp), self._sign * torque
            _put(rows, t, ft=torque)
            if not self._angle_is_deflection and not math.isnan(self._stiffness):
                _put(rows, t, deflection=torque / self._stiffness)
        for stamp, (distal, proximal, disturbance) in self._of("torque_estimate"):
            _put(rows, self._seconds(stamp), distal=distal, proximal=proximal, disturbance=disturbance)
        for stamp, (torque,) in self._of("torque_command"):
            _put(rows, self._seconds(stamp or self.newest), command=torque)
        return rows

    def state(self) -> Mapping[str, Any]:
        """Return bench, health and rates, Hz, since the last call."""
        now = time.monotonic()
        span, self._counted = max(now - self._counted, 1e-3), now
        rates = {topic: round(count / span) for topic, count in self._counts.items() if count}
        self._counts = dict.fromkeys(self._boxes, 0)
        self._health = {name: each for name, each in self._health.items() if now - each[0] < GONE}
        shown = [_status_json(now - heard, each) for _, (heard, each) in sorted(self._health.items())]
        return {"bench": self.bench, "health": shown, "rates": rates}

    def _of(self, topic: str) -> Sequence[tuple[int, Sequence[float]]]:
        taken = [(stamp, numbers) for stamp, numbers, _ in self._boxes[topic].take(ros.MEASUREMENT.depth)]
        self._counts[topic] += len(taken)
        return taken

    def _seconds(self, stamp: int) -> float:
        self._epoch = self._epoch or stamp
        return (stamp - self._epoch) / ros.SECOND

    def _on_flag(self, message: ros.Bool) -> None:
        self.flag = bool(message.data)

    def _on_health(self, message: ros.DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith(self._namespace) and len(self._health) < MOST_NODES:
                self._health[status.name] = (time.monotonic(), {
                    "name": status.name, "level": status.level[0], "message": status.message,
                    "values": [(each.key, each.value) for each in status.values],
                })  # fmt: skip


def _put(rows: Rows, t: float, **values: float) -> None:
    for name, value in values.items():
        rows.setdefault(name, []).append((t, value))


def _status_json(age: float, status: Mapping[str, Any]) -> Mapping[str, Any]:
    if age < SILENT:
        return status
    return {**status, "level": STALE, "message": f"silent for {age:.0f} s; before: {status['message']}"}


LEAD = ros.SECOND // 50
"""ns by which a command is published before it takes effect: longer than this process is held up."""
MARGIN = ros.SECOND // 200
"""A command that has less than this left until it takes effect is left out, as by excite."""
LIMITS = ("torque_limit", "slew_limit", "soft_start")
"""Parameters of a driver; a plant has none. A negative one is derived: the driver itself cuts commands."""
LOOK = 0.5
"""s between looks at who is there."""
ANSWER = 2.0
"""s after which limits are requested again: the first answer of a bench just found may be lost."""


class WatchCommand:
    """Commands of a page on the grid of the measurements. why_not: why none may be held now, or nothing."""

    def __init__(self, node: Node, source: WatchSource, values: Mapping[str, Any]) -> None:
        self._node, self._source = node, source
        self._rate: float = values["rate"]
        self._most = Bounds(values["limit"], math.inf, values["growth"])
        self.commander = Commander()
        self.why_not = "nothing is known of the bench yet"
        self._publisher = node.create_publisher(ros.JointState, "torque_command", ros.COMMAND)
        self._writer = ros.raw_writer(ros.torque_command_message(0, 0.0, values["joint"]), "effort")
        self._bench = ""
        self._client: AsyncParameterClient | None = None
        self._asked = -math.inf
        self._cycle: ros.Cycle | None = None
        self._due = 0.0

    def look(self) -> None:
        """Check the publishers, and start or end the cycle. Raises its error."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + LOOK
            self._see_to_the_limits()
            self.why_not = self._reason()
        if self._cycle is not None:
            self._cycle.is_running()
            if not self.commander.active:
                self._cycle.stop()
                self._cycle = None
        elif self.commander.active and self._source.newest:
            self._cycle = ros.Cycle(self._rate, self._step, catch_up=False)
            earliest = time.time_ns() + 2 * LEAD
            self._cycle.start(ros.on_grid(earliest, self._source.newest, self._rate) - LEAD)

    def close(self) -> None:
        """End with zeros that have arrived, whichever page holds the command."""
        if self.commander.holder is not None:
            self.commander.release(self.commander.holder)
        deadline = time.monotonic() + 1.0
        while self._cycle is not None and self.commander.active and time.monotonic() < deadline:
            time.sleep(0.01)
        if self._cycle is not None:
            self._cycle.stop()
        ros.await_arrival(self._publisher)

    def _step(self, stamp: int) -> None:
        assert self._cycle is not None
        anchor = self._cycle.anchor
        torque = self.commander.torque((stamp - anchor.offset) / ros.SECOND)
        if torque is not None and stamp + LEAD - anchor.now() > MARGIN:
            self._publisher.publish(self._writer.write(stamp + LEAD, [torque]))

    def _see_to_the_limits(self) -> None:
        """Request the limits from the publisher of joint_states until it has said them."""
        bench = ", ".join(sorted(ros.publishers_of(self._node, "joint_states")))
        if bench != self._bench:
            self._bench, self._client, self._asked, self.commander.bounds = bench, None, -math.inf, None
        if not bench or "," in bench or self.commander.bounds is not None:
            return
        self._client = self._client or AsyncParameterClient(self._node, bench)
        if time.monotonic() > self._asked + ANSWER and self._client.services_are_ready():
            self._asked = time.monotonic()
            self._client.get_parameters(list(LIMITS)).add_done_callback(partial(self._on_limits, bench))

    def _on_limits(self, bench: str, future: Any) -> None:
        if bench != self._bench:  # that bench has left
            return
        told = future.result().values
        values = [v.double_value if v.type and v.double_value >= 0.0 else math.inf for v in told]
        torque, slew, growth = [*values, math.inf, math.inf, math.inf][:3]
        most = self._most
        self.commander.bounds = Bounds(min(torque, most.torque), slew, min(growth, most.growth))

    def _reason(self) -> str:
        others = ros.publishers_of(self._node, "torque_command") - {self._node.get_fully_qualified_name()}
        if others:
            return f"{', '.join(sorted(others))} commands already"
        if not self._bench:
            return "nobody publishes joint_states"
        if "," in self._bench:
            return f"{self._bench} publish joint_states, expected one"
        return f"{self._bench} has not said its limits yet" if self.commander.bounds is None else ""


TABLE = (
    ros.NodeParameter("host", "localhost", "where the page is served; 0.0.0.0: in the network too"),
    ros.NodeParameter("port", 8270, "of the page; 0: any", "", 0, 65535),
    ros.NodeParameter("command", False, "whether a page may command torque"),
    ros.NodeParameter(
        "limit", 10.0, "largest torque of the page; the driver's counts where it is less", "N m", 0.0, 1e3
    ),
    ros.NodeParameter(
        "growth", 20.0, "of a page's torque; the driver's soft_start counts where it is less",
        "N m/s", 0.1, 1e4,
    ),
    ros.NodeParameter("rate", 280.0, "of the page's commands, as the bench runs", "Hz", 50.0, 1000.0),
    ros.NodeParameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a file"),
    ros.NodeParameter("out", "runs", "folder of the recordings"),
    ros.AXIS,
    ros.JOINT,
)


class WatchNode(ros.Program):
    """The subscriptions, the server, and the commands where they are permitted."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        rig = load_rig(values["rig"])
        self._source = WatchSource(node, rig, values["axis"], values["joint"])
        self._command = WatchCommand(node, self._source, values) if values["command"] else None
        commander = self._command.commander if self._command is not None else None
        self._server = Server(self._source, _runs(node, values), commander, values["host"], values["port"])
        if self._command is not None:
            self._server.desk.why_not = lambda: self._command.why_not if self._command is not None else ""
        self._health = ros.Health(node, self._report, values["rig"])
        self._server.start()
        for address in self._server.addresses:  # not to the log: it has the token
            sys.stderr.write(f"open {address}\n")

    def is_finished(self) -> bool:
        """Run until stopped."""
        if self._command is not None:
            self._command.look()
        return not self._server.is_running()

    def close(self) -> None:
        """Zero torque; end pages, recordings and evaluations."""
        if self._command is not None:
            self._command.close()
        self._server.stop()

    def _report(self) -> ros.NodeHealth:
        held = self._command is not None and self._command.commander.holder is not None
        pages = self._server.desk.count
        summary = f"{pages} pages open" if pages != 1 else "1 page open"
        return ros.NodeHealth(ros.OK, summary, {"pages": pages, "commanding": held})


def _runs(node: Node, values: dict[str, Any]) -> Runs:
    """Return the folder of the recordings of this bench."""
    namespace = node.get_namespace()
    axis = f"--axis={values['axis']}"
    verbs = ["--rig", values["rig"], "--namespace", namespace, "--joint", values["joint"], axis]
    return Runs(Path(values["out"]), ["-r", f"__ns:={namespace}"], verbs)


NODE = ros.Component("watch", TABLE, WatchNode)
main = NODE.run

if __name__ == "__main__":
    sys.exit(main())
