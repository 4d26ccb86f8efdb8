"""watch: the live view, a page in a browser. It listens, and commands only where it was started to."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from rclpy.node import Node

from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._health import OK, Health, NodeHealth
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter
from rsea_ros.nodes._run import Program, run_node
from rsea_ros.nodes._watch_source import WatchCommand, WatchSource
from rsea_ros.watch.runs import Runs
from rsea_ros.watch.server import Server

TABLE = (
    NodeParameter("host", "localhost", "where the page is served; 0.0.0.0: in the network too"),
    NodeParameter("port", 8270, "of the page; 0: any", "", 0, 65535),
    NodeParameter("command", False, "whether a page may command torque"),
    NodeParameter(
        "limit", 10.0, "largest torque of the page; the driver's counts where it is less", "N m", 0.0, 1e3
    ),
    NodeParameter(
        "growth",
        20.0,
        "of a page's torque; the driver's soft_start counts where it is less",
        "N m/s",
        0.1,
        1e4,
    ),
    NodeParameter("rate", 280.0, "of the page's commands, as the bench runs", "Hz", 50.0, 1000.0),
    NodeParameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a file"),
    NodeParameter("out", "runs", "folder of the recordings"),
    AXIS,
    JOINT,
)


class WatchNode(Program):
    """The subscriptions, the server, and the commands where they are permitted."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        rig = load_rig(values["rig"])
        self._source = WatchSource(node, rig, values["axis"], values["joint"])
        self._command = WatchCommand(node, self._source, values) if values["command"] else None
        commander = self._command.commander if self._command is not None else None
        self._server = Server(self._source, _runs(node, values), commander, values["host"], values["port"])
        if self._command is not None:
            self._server.desk.why_not = lambda: self._command.why_not if self._command is not None else ""
        self._health = Health(node, self._report, values["rig"])
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

    def _report(self) -> NodeHealth:
        held = self._command is not None and self._command.commander.holder is not None
        pages = self._server.desk.count
        summary = f"{pages} pages open" if pages != 1 else "1 page open"
        return NodeHealth(OK, summary, {"pages": pages, "commanding": held})


def _runs(node: Node, values: dict[str, Any]) -> Runs:
    """Return the folder of the recordings of this bench."""
    namespace = node.get_namespace()
    axis = f"--axis={values['axis']}"
    verbs = ["--rig", values["rig"], "--namespace", namespace, "--joint", values["joint"], axis]
    return Runs(Path(values["out"]), ["-r", f"__ns:={namespace}"], verbs)


def main() -> int:
    """Run the node."""
    return run_node("watch", TABLE, WatchNode)


if __name__ == "__main__":
    sys.exit(main())
