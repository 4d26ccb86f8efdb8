"""Child processes: they end on request, and never outlive the process that started them."""

from __future__ import annotations

import ctypes
import signal
import subprocess
from collections.abc import Sequence
from typing import Any

PATIENCE = 10.0
"""s that a program gets to end: a driver ramps its torque down and switches it off."""
_PRCTL, _PARENT_DEATH_SIGNAL = ctypes.CDLL(None).prctl, 1


def start(command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a program in a session of its own: a terminal's Ctrl-C reaches it through this process alone.

    options: of Popen.
    """
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=_follow, **options
    )


def stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Ask programs to end (SIGTERM) and wait; kill those that do not."""
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
