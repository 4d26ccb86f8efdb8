"""Nodes that a verb starts, one by one or a graph of them, and ends together."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import did_you_mean, list_names
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.processes import hold_signals, start as start_process, stop

POLL = 0.1
"""s, interval between checks of the running nodes."""


def start(name: str, arguments: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a node by name, with ROS arguments. options: of Popen."""
    return start_process([sys.executable, "-m", f"rsea_ros.nodes.{name}", *arguments], **options)


ROOT = Path(__file__).resolve().parents[2]


class Processes:
    """Start nodes, wait for them, and leave none behind."""

    def __init__(self, logs: Path, domain: int) -> None:
        logs.mkdir(parents=True, exist_ok=True)
        self._logs = logs
        self._log_of: dict[str, Path] = {}
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_LOG_DIR": str(logs / "ros"),
            "RCUTILS_COLORIZED_OUTPUT": "0",
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *error: object) -> None:
        with hold_signals():
            self.stop(*self._running)

    def log(self, node: str) -> Path:
        return self._log_of.get(node, self._logs / f"{node}.log")

    def pid(self, node: str) -> int:
        return self._running[node].pid

    def start(self, node: str, parameters: Mapping[str, object]) -> None:
        """Start a node; signals of the terminal reach only this process, which then stops the node."""
        names = (self._logs / (f"{node}-{k}.log" if k > 1 else f"{node}.log") for k in count(1))
        self._log_of[node] = next(name for name in names if not name.exists())
        with hold_signals(), self.log(node).open("xb") as log:
            words, options = ["--ros-args", *parameter_words(parameters)], {"env": self._environment}
            self._running[node] = start(node, words, stdout=log, stderr=subprocess.STDOUT, **options)

    def wait(self, node: str, timeout: float, progress: Callable[[float], None] = lambda share: None) -> None:
        """Wait until a node has ended, and report the last percentage that it logged.

        Raises RseaError if it fails, if another one ends before it, and after `timeout` seconds without a
        line of its log: beside other work it takes longer, and gets on.
        """
        deadline, logged = time.monotonic() + timeout, 0
        while self._running[node].poll() is None:
            for other in [name for name, process in self._running.items() if process.poll() is not None]:
                if other != node:
                    raise self._failure(other, "ended too early")
            if (size := self.log(node).stat().st_size) != logged:
                deadline, logged = time.monotonic() + timeout, size
            if time.monotonic() > deadline:
                raise self._failure(node, f"got no further for {timeout:g} s")
            progress(self._share(node))
            time.sleep(POLL)
        if self._running[node].returncode != 0:
            raise self._failure(node, "failed")
        del self._running[node]
        progress(1.0)

    def stop(self, *nodes: str) -> None:
        """Stop the nodes (SIGTERM), wait, and kill those that do not end."""
        stop([self._running.pop(node) for node in nodes])

    def _share(self, node: str) -> float:
        shares = re.findall(rb"\b(\d+)%", self.log(node).read_bytes())
        return int(shares[-1]) / 100.0 if shares else 0.0

    def _failure(self, node: str, event: str) -> RseaError:
        """Return an error with the last line of a node."""
        lines = self.log(node).read_text(errors="replace").splitlines()
        last = re.sub(r"^\[\w+\] \[[\d.]+\] \[[^]]*\]: ", "", lines[-1]) if lines else "no output"
        return RseaError(f"{node} {event}: {last} (log: {self.log(node)})")


def parameter_words(parameters: Mapping[str, object]) -> list[str]:
    """Return parameters as words of a ROS command line, texts and booleans in its syntax."""
    plain = {n: v if isinstance(v, (bool, int, float)) else str(v) for n, v in parameters.items()}
    texts = (f"{name}:={json.dumps(value, ensure_ascii=False)}" for name, value in plain.items())
    return [word for text in texts for word in ("-p", text)]


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
        while any(process.poll() is None for process in running.values()):
            if failed := _first_failure(running):
                print(f"{failed} ended with status {running[failed].returncode}: stopping the others")
                return running[failed].returncode
            time.sleep(POLL)
        failed = _first_failure(running)
        return running[failed].returncode if failed else 0
    finally:
        with hold_signals():
            stop(list(running.values()))


def _first_failure(running: Mapping[str, subprocess.Popen[bytes]]) -> str | None:
    return next((name for name, process in running.items() if process.poll() not in (None, 0)), None)


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
    values |= _parse_assignments(assignments)
    content = _graph()
    first = content["graphs"][graph]
    chosen = {first: content["first"][first]}
    chosen |= {name: settings for name, settings in content["others"].items() if _is_true(name, values[name])}
    return [_call(name, settings, values) for name, settings in chosen.items()]


def _parse_assignments(assignments: Sequence[str]) -> dict[str, str]:
    known = arguments_of_graphs()
    given: dict[str, str] = {}
    for assignment in assignments:
        name, sign, value = assignment.partition(":=")
        if not sign:
            raise ParameterError(f"argument {assignment!r}, expected NAME:=VALUE")
        if name not in known:
            near = did_you_mean(name, known)
            raise ParameterError(f"argument {name!r}, expected one of {', '.join(known)}{near}")
        given[name] = value
    return given


def _call(name: str, settings: Mapping[str, str], values: Mapping[str, str]) -> NodeCall:
    file = Path(values["params"]) if name == "driver" else _config() / f"{name}.yaml"
    parameters = {parameter: values[argument] for parameter, argument in settings.items()}
    return NodeCall(name, values["namespace"], file, parameters)


def _is_true(name: str, value: str) -> bool:
    if value.lower() not in ("true", "false"):
        raise ParameterError(f"{name}:={value}, expected true or false")
    return value.lower() == "true"


def _graph() -> Mapping[str, Any]:
    content: Mapping[str, Any] = strict_yaml.read(_share() / "launch" / "graph.yaml").content
    return content


def _config() -> Path:
    return _share() / "config" / "nodes"


def parameters_of_bench() -> Path:
    """Return the file of the parameters that a driver needs on `rsea bench`."""
    return _share() / "config" / "simulated_bench.yaml"


def _share() -> Path:
    """Return the folder of config/ and launch/: the clone, or the share of the installed package."""
    from rsea_ros.model.rig_file import rig_folders  # and a compiler, for which a stop must not wait

    return next(folder.parents[1] for folder in rig_folders())


def need_ros() -> None:
    """Raise RseaError if rclpy is missing."""
    if find_spec("rclpy") is None:
        raise RseaError("rclpy is missing, expected a sourced ROS 2, or ./rsea in a clone on x86_64")
