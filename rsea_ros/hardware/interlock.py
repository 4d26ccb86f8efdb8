"""What keeps the torque of a joint away, and what of it a request that takes time may end.

clear_fault, reboot and an activation take up to seconds, and anything may be requested or fail meanwhile. All
events of all joints have a number, from one count: a request ends only what came before it.
"""

from __future__ import annotations

import itertools
import math
import threading
from dataclasses import dataclass

from rsea_ros.documents.units import plain
from rsea_ros.errors import DeviceError

_EVENTS = itertools.count(1)

MEANWHILE = "stopped: ~/stop was called meanwhile, expected a clear_fault after it"


def event() -> int:
    """Return the number of what happens now."""
    return next(_EVENTS)


@dataclass(frozen=True)
class DeviceFault:
    """Why there is no torque: cause, value, limit, unit; detail: in words."""

    cause: str
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""
    detail: str = ""

    def __str__(self) -> str:
        unit = plain(self.unit)
        measured = f" {self.value:.4g} {unit}, limit {self.limit:.4g} {unit}"
        return f"{self.cause}:" + ("" if math.isnan(self.value) else measured) + f" {self.detail}".rstrip()


class Interlock:
    """Activity, stop and fault of a joint. Any thread may call any method at any moment.

    enabled: whether the joint is active. stopped: whether a stop was requested that no later clear has ended.
    fault: the first one since the last clear. halted: whether the program is to end, which nothing undoes.
    """

    def __init__(self) -> None:
        self.fault: DeviceFault | None = None
        self.stopped = self.enabled = self.halted = False
        self._lock = threading.Lock()
        self._stopped_at = self._disabled_at = self._unanswered = 0
        self._newest: tuple[int, DeviceFault] | None = None

    @property
    def is_free(self) -> bool:
        """Whether there may be torque."""
        return self.enabled and not (self.halted or self.stopped) and self.fault is None

    def trip(self, fault: DeviceFault) -> bool:
        """Latch a fault; return whether none was latched before."""
        with self._lock:
            self._newest, is_first = (event(), fault), self.fault is None
            self.fault = self.fault or fault
            return is_first

    def stop(self, *, is_answered: bool = True) -> None:
        """Let there be no torque until a clear that is asked for later; not answered: later than `answer`."""
        with self._lock:
            self._stopped_at, self.stopped = event(), True
            self._unanswered += not is_answered

    def answer(self) -> None:
        """Note that a stop is answered now."""
        with self._lock:
            self._stopped_at, self._unanswered = event(), max(self._unanswered - 1, 0)

    def disable(self) -> None:
        """End the activity."""
        with self._lock:
            self._disabled_at, self.enabled = event(), False

    def end_fault(self, began: int) -> None:
        """End the faults from before a number. Raises DeviceError where there are later ones, which stay."""
        with self._lock:
            self.fault = self._newest[1] if self._newest is not None and self._newest[0] > began else None
            if self.fault is not None:
                raise DeviceError(f"fault {self.fault} came meanwhile, expected clear_fault after it")

    def end_stop(self, asked: int) -> None:
        """End the stops from before a number. Raises DeviceError where there is a later one, which stays."""
        with self._lock:
            self.stopped = self.stopped and (self._unanswered > 0 or self._stopped_at > asked)
            if self.stopped:
                raise DeviceError(MEANWHILE)

    def check(self) -> None:
        """Raise DeviceError while a fault or a stop is latched."""
        if self.fault is not None:
            raise DeviceError(f"fault {self.fault}, expected clear_fault first")
        if self.stopped:
            raise DeviceError("stopped: ~/stop was called, expected clear_fault first")

    def enable(self, asked: int) -> None:
        """Become active. Raises DeviceError where a fault or a stop is latched, or its end came since."""
        with self._lock:
            self.check()
            if self._disabled_at > asked:
                raise DeviceError("deactivated meanwhile, expected another activation after it")
            self.enabled = True
