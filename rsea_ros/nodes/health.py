"""health: watches a joint at work, reports changes, keeps the last minutes as a bag. It only listens."""

from __future__ import annotations

import os
import shlex
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.node import Node

from rsea_ros.documents.units import with_unit
from rsea_ros.health.health_finding import HealthFinding, WatchSettings
from rsea_ros.health.monitor import Monitor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._commands import WATCHDOG
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._findings import FindingsPublisher, Keeper, Ring, instant, sentence
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, NodeHealth
from rsea_ros.nodes._health_inputs import Events, HealthInputs, noise_from
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter
from rsea_ros.nodes._run import NAMESPACE, Program, run_node

TABLE = (
    NodeParameter(
        "rig", "paper_high_impedance", "the joint as it was: a name of config/rigs, or the last model.yaml"
    ),
    NodeParameter(
        "identification", "", "identification.json whose measured noise counts; empty: that of the rig"
    ),
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
)
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
        rig = load_rig(values["rig"])
        settings = WatchSettings(
            rate=values["false_alarms"], every=values["every"], learn=values["learn"], hold=WATCHDOG / SECOND
        )
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
        return NodeHealth(WARN if troubles else OK, "; ".join(troubles) or usual, self._values())

    def _values(self) -> dict[str, object]:
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


def main() -> int:
    """Run the node."""
    return run_node("health", TABLE, HealthNode)


if __name__ == "__main__":
    sys.exit(main())
