"""Several nodes in the foreground: one word stops them all, and none stays behind."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence

from rsea_ros.interrupts import undisturbed

_PATIENCE = 10.0
"""s that a node gets to end: a driver ramps its torque down and switches it off."""
_POLL = 0.1
_PRCTL, _PARENT_DEATH_SIGNAL = ctypes.CDLL(None).prctl, 1


def together(nodes: Mapping[str, Sequence[str]]) -> int:
    """Run nodes, by name with their arguments, until all have ended; return the first status that is not 0.

    A node that fails ends the others: a graph with a part missing is not what was asked for.
    Raises Stopped, once all have ended, when a signal asks this process to stop.
    """
    running: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name, arguments in nodes.items():
            with undisturbed():
                running[name] = _start(name, arguments)
        while any(process.poll() is None for process in running.values()):
            if failed := _failed(running):
                print(f"{failed} ended with status {running[failed].returncode}: stopping the others")
                return running[failed].returncode
            time.sleep(_POLL)
        failed = _failed(running)
        return running[failed].returncode if failed else 0
    finally:
        with undisturbed():
            _stop(list(running.values()))


def _start(name: str, arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a node in a session of its own: a terminal's Ctrl-C reaches it through this process alone."""
    command = [sys.executable, "-m", f"rsea_ros.nodes.{name}", *arguments]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=_follow)


def _failed(running: Mapping[str, subprocess.Popen[bytes]]) -> str | None:
    return next((name for name, process in running.items() if process.poll() not in (None, 0)), None)


def _stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Ask all to end, wait for it, and kill what does not."""
    for process in processes:
        if process.poll() is None:
            process.terminate()
    for process in processes:
        try:
            process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _follow() -> None:
    """Have the kernel end this process when the one that started it is killed."""
    _PRCTL(_PARENT_DEATH_SIGNAL, signal.SIGTERM)
