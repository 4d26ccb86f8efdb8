"""Nodes that a verb starts, and ends together."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from typing import Any

from rsea_ros.errors import RseaError
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
            shares = re.findall(rb"\b(\d+)%", self.log(node).read_bytes())
            progress(int(shares[-1]) / 100.0 if shares else 0.0)
            time.sleep(POLL)
        if self._running[node].returncode != 0:
            raise self._failure(node, "failed")
        del self._running[node]
        progress(1.0)

    def stop(self, *nodes: str) -> None:
        """Stop the nodes (SIGTERM), wait, and kill those that do not end."""
        stop([self._running.pop(node) for node in nodes])

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


def parameters_of_bench() -> Path:
    """Return the file of the parameters that a driver needs on `rsea bench`."""
    return share() / "config" / "simulated_bench.yaml"


def share() -> Path:
    """Return the folder of config/ and launch/: the clone, or the share of the installed package."""
    from rsea_ros.model.rig_file import rig_folders  # and a compiler, for which a stop must not wait

    return next(folder.parents[1] for folder in rig_folders())


def need_ros() -> None:
    """Raise RseaError if rclpy is missing."""
    if find_spec("rclpy") is None:
        raise RseaError("rclpy is missing, expected a sourced ROS 2, or ./rsea in a clone on x86_64")
