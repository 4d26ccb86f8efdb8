"""`rsea launch`: start a graph of nodes without `ros2 launch`."""

import argparse
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rsea_ros.cli._processes import POLL, need_ros, share, start
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import did_you_mean, list_names
from rsea_ros.errors import ParameterError
from rsea_ros.processes import hold_signals, stop

HELP = "start a graph of nodes: simulation, hardware or replay; Ctrl-C stops them all"
EXAMPLE = "rsea launch simulation rig:=paper_moving_output excite:=true record:=true"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("graph", metavar="GRAPH", help=", ".join(graph_names()))
    rows = "\n".join(
        f"  {name:<11} {about} (default {default or 'none'})"
        for name, (default, about) in arguments_of_graphs().items()
    )
    parser.add_argument("arguments", nargs="*", metavar="NAME:=VALUE", help="see below")
    parser.epilog = f"arguments:\n{rows}\n\n{parser.epilog}"


def run(args: argparse.Namespace) -> int:
    """Start the nodes and wait until they have ended; return the worst of their statuses."""
    need_ros()
    return together({call.name: call.arguments for call in node_calls(args.graph, args.arguments)})


def together(nodes: Mapping[str, Sequence[str]]) -> int:
    """Run nodes, by name with their arguments, until all have ended; return the first nonzero status.

    If a node fails, the others are stopped, because the graph is no longer complete.
    Raises Stopped, once all have ended, when a signal asks this process to stop.
    """
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, arguments in nodes.items():
            with hold_signals():
                running[name] = start(name, arguments)
        while True:
            statuses = {name: process.poll() for name, process in running.items()}
            failed, status = next((item for item in statuses.items() if item[1]), ("", 0))
            if None not in statuses.values():
                return status or 0
            if status:
                print(f"{failed} ended with status {status}: stopping the others")
                return status
            time.sleep(POLL)
    finally:
        with hold_signals():
            stop(list(running.values()))


@dataclass(frozen=True)
class NodeCall:
    """A node to start. `parameters` override the parameter file."""

    name: str
    namespace: str
    file: Path
    parameters: Mapping[str, str]

    @property
    def arguments(self) -> list[str]:
        given = [word for name, value in self.parameters.items() for word in ("-p", f"{name}:={value}")]
        namespace = f"__ns:=/{self.namespace.strip('/')}"
        return ["--ros-args", "-r", namespace, "--params-file", str(self.file), *given]


def graph_names() -> Sequence[str]:
    """Return the names of the graphs: simulation, hardware, replay."""
    return tuple(_graph()["graphs"])


def arguments_of_graphs() -> Mapping[str, tuple[str, str]]:
    """Return default and meaning of every argument by name."""
    return {
        name: (default.format(config=_config()), about)
        for name, (default, about) in _graph()["arguments"].items()
    }


def node_calls(graph: str, assignments: Sequence[str]) -> list[NodeCall]:
    """Return the nodes of a graph for arguments of the form `name:=value`.

    Raises ParameterError for a graph or an argument that does not exist.
    """
    names = graph_names()
    if graph not in names:
        raise ParameterError(
            f"graph {graph!r}, expected {list_names(names, 'or')}{did_you_mean(graph, names)}"
        )
    values = {name: default for name, (default, _) in arguments_of_graphs().items()}
    for assignment in assignments:
        name, sign, value = assignment.partition(":=")
        if not sign:
            raise ParameterError(f"argument {assignment!r}, expected NAME:=VALUE")
        if name not in values:
            near = did_you_mean(name, values)
            raise ParameterError(f"argument {name!r}, expected one of {', '.join(values)}{near}")
        values[name] = value
    content = _graph()
    first = content["graphs"][graph]
    chosen = {first: content["first"][first]}
    chosen |= {name: settings for name, settings in content["others"].items() if _is_true(name, values[name])}
    return [_call(name, settings, values) for name, settings in chosen.items()]


def _call(name: str, settings: Mapping[str, str], values: Mapping[str, str]) -> NodeCall:
    file = Path(values["params"]) if name == "driver" else _config() / f"{name}.yaml"
    parameters = {parameter: values[argument] for parameter, argument in settings.items()}
    return NodeCall(name, values["namespace"], file, parameters)


def _is_true(name: str, value: str) -> bool:
    if value.lower() not in ("true", "false"):
        raise ParameterError(f"{name}:={value}, expected true or false")
    return value.lower() == "true"


def _graph() -> Mapping[str, Any]:
    content: Mapping[str, Any] = strict_yaml.read(share() / "launch" / "graph.yaml").content
    return content


def _config() -> Path:
    return share() / "config" / "nodes"
