"""Protection that ends the torque when the driver's process dies or hangs; each device states its kind."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.hardware.supervised import Supervisor

BUS_WATCHDOG, SUPERVISOR, PROCESS, NONE = "bus watchdog", "supervisor", "process", "none"


class Protection:
    """Protection against a dead host that needs nothing done, or none.

    kind: BUS_WATCHDOG, the device's own; PROCESS, where the torque is the process's own, as of a simulation;
    NONE. within: s after the driver's last transaction until there is no torque.
    """

    def __init__(self, kind: str, within: float = math.nan) -> None:
        self._kind, self._within = kind, within

    @property
    def kind(self) -> str:
        """The present kind."""
        return self._kind

    def beat(self, armed: bool | None = None) -> None:
        """Report that the driver runs, and whether torque is commanded (None: as before)."""

    def __str__(self) -> str:
        return self.kind if math.isnan(self._within) else f"{self.kind}, {self._within:g} s"


class Supervised(Protection):
    """A supervisor process that sends frames to the device when the driver is dead or hangs.

    A device calls `guard` once its port is open, and `release` before it closes it; the beats are Guarded's.
    within: s. service: socket of a supervisor that runs as a service; empty: a child process.
    """

    def __init__(self, within: float, service: str = "") -> None:
        super().__init__(SUPERVISOR, within)
        self._service = service
        self._supervisor: Supervisor | None = None

    @property
    def kind(self) -> str:
        """SUPERVISOR between `guard` and `release`, else NONE."""
        return NONE if self._supervisor is None else SUPERVISOR

    def guard(self, descriptor: int, frames: Sequence[bytes], replies: Sequence[bytes] = ()) -> None:
        """Let a supervisor watch, a new one where the last is dead.

        frames: bytes that end the torque when they are written to the descriptor. replies: what the device
        sends to acknowledge one of them; the supervisor repeats it until then. Raises SupervisorLost.
        """
        if self._supervisor is not None and not self._supervisor.alive():
            self._supervisor.close()
            self._supervisor = None
        if self._supervisor is None:
            self._supervisor = Supervisor(descriptor, self._within, frames, replies, self._service)

    def beat(self, armed: bool | None = None) -> None:
        """Beat. Raises SupervisorLost, HeldUp."""
        if self._supervisor is not None:
            self._supervisor.beat(armed)

    def release(self, *, safe: bool) -> None:
        """End the supervisor. safe: the device has acknowledged zero torque; else the frames are sent."""
        if self._supervisor is not None:
            self._supervisor.close(safe=safe)
            self._supervisor = None
