"""The driver's end of the supervisor: start it, beat, end it in peace."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from rsea_ros.errors import DeviceError

SCRIPT = Path(__file__).with_name("supervisor.py")


class SupervisorLost(DeviceError):
    """The process that would stop the motor after the driver's death is dead itself."""


class Supervisor:
    """Sends `frames` on `descriptor` when this process ends, or does not beat for `timeout` s."""

    def __init__(self, descriptor: int, timeout: float, frames: Sequence[bytes]) -> None:
        words = [str(descriptor), f"{timeout:g}", *(frame.hex() for frame in frames)]
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(SCRIPT), *words], stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=(descriptor,),
            start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin is not None
        self._beats = self._process.stdin.fileno()

    def beat(self, armed: bool) -> None:
        """Say that this process lives, and whether torque is on. Raises SupervisorLost."""
        try:
            os.write(self._beats, b"a" if armed else b"d")
        except OSError as error:
            raise SupervisorLost(f"supervisor process: {error.strerror}, expected it to run") from None

    def close(self, *, safe: bool = True) -> None:
        """End it. safe: the motor has acknowledged zero torque; else the supervisor sends its frames."""
        assert self._process.stdin is not None
        if safe and self._process.poll() is None:
            os.write(self._beats, b"q")
        self._process.stdin.close()
        self._process.wait()
