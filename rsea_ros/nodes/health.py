"""health: watches a joint at work, reports changes, keeps the last minutes as a bag. It only listens."""

import math
import os
import shlex
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.node import Node

from msg_adapters import BagWriter
from msg_adapters.ros import ERROR, DiagnosticArray, statuses_message
from rsea_ros.documents.units import with_unit
from rsea_ros.health.health_finding import TABLE as CODES, HealthFinding, WatchSettings
from rsea_ros.health.monitor import Monitor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._commands import WATCHDOG
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, NodeHealth
from rsea_ros.nodes._joint_inputs import IDENTIFICATION, Events, HealthInputs, noise_from
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter, let_change, live
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes._run import NAMESPACE, Component, Program
from rsea_ros.outputs.files import unused_path

SEVERE = ("RSEA_SENSOR_FROZEN", "RSEA_SENSOR_MISSING")
"""Codes whose level is ERROR: nobody must trust what such a sensor says."""
Row = tuple[str, bytes, str, Mapping[str, object]]


class FindingsPublisher:
    """Publishes a status for every code once a second. stamp: converts the seconds of a finding to ns."""

    def __init__(
        self,
        node: Node,
        joint: str,
        findings: Callable[[], Sequence[HealthFinding]],
        stamp: Callable[[float], int],
    ) -> None:
        self._name, self._joint = node.get_fully_qualified_name(), joint
        self._findings, self._stamp = findings, stamp
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", COMMAND)
        node.create_timer(1.0, self.publish, clock=STEADY)

    def publish(self) -> None:
        """Publish now."""
        findings = self._findings()
        rows = [self._row(code.name, [f for f in findings if f.code == code.name]) for code in CODES]
        self._publisher.publish(statuses_message(time.time_ns(), rows, self._joint))

    def _row(self, code: str, findings: Sequence[HealthFinding]) -> Row:
        name = f"{self._name}: {code}"
        if not findings:
            return name, OK, "no", {"code": code}
        level = ERROR if code in SEVERE else WARN
        values: dict[str, object] = {"code": code}
        for finding in findings:
            prefix = f"{finding.name}." if len(findings) > 1 else ""
            values |= {f"{prefix}{key}": value for key, value in self._values(finding).items()}
        return name, level, "; ".join(sentence(f) for f in findings), values

    def _values(self, finding: HealthFinding) -> dict[str, object]:
        values: dict[str, object] = {"name": finding.name, "confidence": f"{finding.confidence:.3f}"}
        if math.isfinite(finding.size):
            low, high = finding.ci95
            values |= {"size": f"{finding.size:.5g}", "low": f"{low:.5g}", "high": f"{high:.5g}"}
            values["unit"] = finding.unit
        if math.isfinite(finding.since):
            values["since"] = instant(self._stamp(finding.since))
        return values


def sentence(finding: HealthFinding) -> str:
    """Return a finding in a line."""
    if not math.isfinite(finding.size):
        return finding.name or finding.code
    low, high = finding.ci95
    size = with_unit(f"{finding.size:.4g}", finding.unit)
    return f"{finding.name} changed by {size} ({low:.4g} to {high:.4g})"


def instant(stamp: int) -> str:
    """Return a stamp, ns since 1970, as UTC."""
    return datetime.fromtimestamp(stamp / SECOND, timezone.utc).isoformat(timespec="milliseconds")


class Message(NamedTuple):
    """A serialised message. at: ns of its arrival."""

    topic: str
    msgtype: str
    at: int
    raw: bytes


class Ring:
    """The newest messages, bounded by seconds and megabytes."""

    def __init__(self, seconds: float, megabytes: float) -> None:
        self._span, self._most = round(seconds * SECOND), round(megabytes * 1e6)
        self._messages: deque[Message] = deque()
        self.size = 0

    def add(self, topic: str, msgtype: str, at: int, raw: bytes) -> None:
        """Keep a message, and drop those too old or too many."""
        self._messages.append(Message(topic, msgtype, at, raw))
        self.size += len(raw)
        first = self._messages[0]
        while self.size > self._most or abs(at - first.at) > self._span:
            self.size -= len(self._messages.popleft().raw)
            if not self._messages:
                break
            first = self._messages[0]

    def messages(self) -> list[Message]:
        """Return the kept messages."""
        return list(self._messages)


class Keeper:
    """Writes bags in a thread. folder: of the bags; most: that it may hold; after: s from alarm to bag."""

    def __init__(self, ring: Ring, folder: Path, most: int, after: float) -> None:
        self._ring, self._folder, self._most, self._after = ring, folder, most, after
        self._pool = ThreadPoolExecutor(1, "bags")
        self._due: tuple[float, str, int] | None = None
        self._writing: Future[Path] | None = None
        self.last: Path | None = None
        self.trouble = ""

    def ask(self, code: str, since: int) -> None:
        """Request a bag of the memory `after` seconds from now. since: ns, of the change."""
        if self._due is None:
            self._due = (time.monotonic() + self._after, code, since)

    def poll(self) -> Path | None:
        """Begin bags that are due; return the folder of one just completed."""
        if self._writing is not None and self._writing.done():
            done, self._writing = self._writing, None
            if error := done.exception():
                self.trouble = f"no bag kept: {error}"
                return None
            self.last, self.trouble = done.result(), ""
            return self.last
        if self._due is not None and self._writing is None and time.monotonic() >= self._due[0]:
            self._begin()
        return None

    def close(self) -> None:
        """Write requested bags, and end."""
        if self._due is not None and self._writing is None:
            self._begin()
        self._pool.shutdown()

    def _begin(self) -> None:
        assert self._due is not None
        (_, code, since), self._due = self._due, None
        held = len([p for p in self._folder.iterdir() if p.is_dir()]) if self._folder.is_dir() else 0
        if held >= self._most:
            self.trouble = f"no bag kept: {self._folder} holds {held}, expected less than {self._most} (bags)"
            return
        path = unused_path(self._folder / f"{time.strftime('%Y%m%d-%H%M%S')}-{code}")
        self._writing = self._pool.submit(_write, path, self._ring.messages(), since)


def _write(path: Path, messages: Sequence[Message], since: int) -> Path:
    """Write bags `before` and `after` an instant (ns), those that have messages, into a folder."""
    for name, part in (
        ("before", [m for m in messages if m.at < since]),
        ("after", [m for m in messages if m.at >= since]),
    ):
        if part:
            with BagWriter(path / name, recording=False) as bag:
                for message in sorted(part, key=lambda m: m.at):
                    bag.write(message.topic, message.msgtype, message.at, message.raw)
    return path


TABLE = live((
    NodeParameter(
        "rig", "paper_high_impedance", "the joint as it was: a name of config/rigs, or the last model.yaml"
    ),
    IDENTIFICATION,
    AXIS,
    JOINT,
    NodeParameter("false_alarms", 1e-3, "of changes, at most so many an hour", "1/h", 1e-6, 10.0),
    NodeParameter(
        "every", 3.0, "from one look of a second to the next, while nothing changes", "s", 1.0, 60.0
    ),
    NodeParameter("learn", 20, "looks that show how the signals scatter when all is right", "", 5, 1000),
    NodeParameter("out", "out/health", "folder of the bags that are kept"),
    NodeParameter("keep", 120.0, "that is in memory, and in a bag", "s", 10.0, 3600.0),
    NodeParameter("memory", 200.0, "that this may take at most", "MB", 1.0, 4000.0),
    NodeParameter("after", 30.0, "from an alarm to the end of its bag", "s", 0.0, 600.0),
    NodeParameter("bags", 10, "that the folder may hold; beyond it none is written", "", 0, 10000),
), {"false_alarms", "every"})  # fmt: skip
TICK = 0.25
"""s between two looks at what has come: a wake-up for each sample would cost more than the work."""
KINDNESS = 10
"""Niceness of this process: whatever keeps the joint going comes first."""
SILENT = 2.0
"""s without any message after which the node says so."""


class HealthNode(Program):
    """Reads the topics four times a second; a thread fits causes, another one writes bags."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._node, self._rig_name, self._axis = node, values["rig"], values["axis"]
        self._values, rig = values, load_rig(values["rig"])
        settings = self._settings()
        self._monitor = Monitor(rig, noise_from(rig, values["identification"]), settings)
        ring = Ring(min(values["keep"], 3600.0), values["memory"])
        self._keeper = Keeper(ring, Path(values["out"]), values["bags"], values["after"])
        self._inputs = HealthInputs(node, values["axis"], values["joint"], ring.add)
        self._pool = ThreadPoolExecutor(1, "causes")
        self._fit: Future[Any] | None = None
        self._heard = time.monotonic()
        with suppress(OSError):
            os.nice(KINDNESS)
        node.create_timer(TICK, self._work, clock=STEADY)
        self._statuses = FindingsPublisher(node, values["joint"], self._monitor.findings, self._inputs.stamp)
        self._health = Health(node, self._report, values["joint"])
        node.get_logger().info(f"rig {rig.name}: at most {settings.rate:g} false alarms an hour")

        let_change(node, TABLE, self._change)

    def _settings(self) -> WatchSettings:
        rate, every, learn = (self._values[name] for name in ("false_alarms", "every", "learn"))
        return WatchSettings(rate=rate, every=every, learn=learn, hold=WATCHDOG / SECOND)

    def _change(self, values: dict[str, Any]) -> None:
        """Watch with other thresholds; what has been learned stays."""
        self._values |= values
        self._monitor.watch(self._settings())

    def _work(self) -> None:
        events = self._inputs.take()
        if len(events[0]):
            self._heard = time.monotonic()
        else:
            self._monitor.sensors.hear_nothing(time.monotonic() - self._heard)
        try:
            self._weigh(events)
        except (ArithmeticError, ValueError) as error:
            self._node.get_logger().error(f"begins anew: {type(error).__name__}: {error}")
            self._monitor.begin()
        if (path := self._keeper.poll()) is not None:
            self._node.get_logger().warning(f"kept {path}: {self._command(path)}")
            self._health.publish()

    def _weigh(self, events: Events) -> None:
        """Pass new events to the monitor, and its fits to the thread."""
        self._monitor.take(*events)
        if self._fit is None and self._monitor.job is not None:
            self._fit = self._pool.submit(self._monitor.job)
        elif self._fit is not None and self._fit.done():
            done, self._fit = self._fit, None
            answer = done.result()
            if self._monitor.job is not None:
                self._report_finding(self._monitor.conclude(answer))

    def _report_finding(self, finding: HealthFinding | None) -> None:
        """Report new findings, and keep a bag of them."""
        if finding is None:
            return
        since = self._inputs.stamp(finding.since)
        self._node.get_logger().warning(f"{finding.code}: {sentence(finding)} since {instant(since)}")
        self._keeper.ask(finding.code, since)
        self._statuses.publish()

    def _command(self, path: Path) -> str:
        name = self._node.get_namespace()
        elsewhere = ["--namespace", name] if name != f"/{NAMESPACE}" else []
        axis = [f"--axis={self._axis}"] if self._axis != AXIS.default else []
        rig = ["--rig", self._rig_name]
        return shlex.join(["rsea", "diagnose", str(path / "after"), *rig, *elsewhere, *axis])

    def _report(self) -> NodeHealth:
        monitor, inputs = self._monitor, self._inputs
        findings = monitor.findings()
        troubles = [f"{f.code}: {sentence(f)}" for f in findings]
        if time.monotonic() - self._heard > SILENT:
            missing = [name for name, count in inputs.counts.items() if not count]
            troubles.append(f"nothing to compare, expected {' and '.join(missing) or 'joint_states and ft'}")
        if self._keeper.trouble:
            troubles.append(self._keeper.trouble)
        usual = "learning how the signals scatter" if monitor.learning else "as the model says"
        return NodeHealth(WARN if troubles else OK, "; ".join(troubles) or usual, self._told())

    def _told(self) -> dict[str, object]:
        monitor, inputs = self._monitor, self._inputs
        values: dict[str, object] = {}
        for e in monitor.estimates():
            size = with_unit(f"{e.value:.5g}", e.unit)
            values[e.name] = f"{size}, 95 %: {e.ci95[0]:.5g} to {e.ci95[1]:.5g}"
            values[f"{e.name}.held"] = str(e.held).lower()
        values |= {"looks": monitor.looks, "still_looks": monitor.still}
        values["learning"] = str(monitor.learning).lower()
        values |= {"refused_messages": inputs.refused, "unstamped": inputs.unstamped, **inputs.counts}
        if self._keeper.last is not None:
            values |= {"bag": self._keeper.last, "diagnose": self._command(self._keeper.last)}
        return values

    def close(self) -> None:
        """Clean up; a requested bag is written."""
        self._pool.shutdown(cancel_futures=True)
        self._keeper.close()


NODE = Component("health", TABLE, HealthNode)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
