"""Several nodes in the foreground; one signal stops them all."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Mapping, Sequence

from rsea_ros.cli._node_process import POLL, start, stop
from rsea_ros.processes import hold_signals


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
