"""The driver's end of the supervisor: start it, beat, end it in peace."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rsea_ros.errors import DeviceError

SURE = 0.8
"""Share of the time-out from which on the supervisor may have acted."""
BEATS = 20
"""A time-out; a beat each cycle would wake the supervisor a thousand times a second."""
SCRIPT = Path(__file__).with_name("supervisor.py")


class SupervisorLost(DeviceError):
    """The process that would stop the motor after the driver's death is dead itself."""


class HeldUp(DeviceError):
    """This process stood still with torque on for about as long as the supervisor bears."""


class Supervisor:
    """Sends `frames` on `descriptor` when this process ends, or does not beat for `timeout` s."""

    def __init__(self, descriptor: int, timeout: float, frames: Sequence[bytes]) -> None:
        self._timeout, self._last, self._told, self._armed = timeout, 0.0, 0.0, False
        words = [str(descriptor), f"{timeout:g}", *(frame.hex() for frame in frames)]
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(SCRIPT), *words], stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=(descriptor,),
            start_new_session=True,
        )  # fmt: skip
        assert self._process.stdin is not None
        self._beats = self._process.stdin.fileno()

    def beat(self, armed: bool | None = None) -> None:
        """Say that this process lives, and whether torque is commanded (None: as before).

        A change of that is told at once, else what was told last counts for a 20th of the time-out.
        Raises SupervisorLost, and HeldUp when the last beat is so old that the supervisor may have acted.
        """
        now = time.monotonic()
        gap, armed_before = now - self._last, self._armed
        self._last, self._armed = now, armed_before if armed is None else armed
        if self._armed != armed_before or now - self._told > self._timeout / BEATS:
            self._told = now
            self._tell()
        if armed_before and gap > SURE * self._timeout:
            limit = f"{1e3 * SURE * self._timeout:.0f} ms"
            raise HeldUp(f"no cycle for {1e3 * gap:.0f} ms, limit {limit}: the motor may have been stopped")

    def _tell(self) -> None:
        try:
            os.write(self._beats, b"a" if self._armed else b"d")
        except OSError as error:
            raise SupervisorLost(f"supervisor process: {error.strerror}, expected it to run") from None

    def close(self, *, safe: bool = True) -> None:
        """End it. safe: the motor has acknowledged zero torque; else the supervisor sends its frames."""
        assert self._process.stdin is not None
        if safe and self._process.poll() is None:
            os.write(self._beats, b"q")
        self._process.stdin.close()
        self._process.wait()
