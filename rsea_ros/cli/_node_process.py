"""A node as a process of its own: it ends when it is asked to, and never outlives the one that started it."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

POLL = 0.1
"""s between looks at whether nodes still run."""
PATIENCE = 10.0
"""s that a node gets to end: a driver ramps its torque down and switches it off."""
_PRCTL, _PARENT_DEATH_SIGNAL = ctypes.CDLL(None).prctl, 1


def start(name: str, arguments: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a node in a session of its own: a terminal's Ctrl-C reaches it through this process alone.

    options: of Popen.
    """
    command = [sys.executable, "-m", f"rsea_ros.nodes.{name}", *arguments]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=_follow, **options
    )


def stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Ask nodes to end (SIGTERM) and wait for it; kill what does not."""
    for process in processes:
        if process.poll() is None:
            process.terminate()
    for process in processes:
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _follow() -> None:
    """Have the kernel end this process when the one that started it is killed."""
    _PRCTL(_PARENT_DEATH_SIGNAL, signal.SIGTERM)
