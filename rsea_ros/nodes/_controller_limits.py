"""When the controller must give up: lateness that persists, an error that stays, a torque too large."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rsea_ros.control.lateness import Lateness, Tolerance

OBEYED, SEEN = 0.05, 3.0
"""s after which a motor makes the torque that is commanded, N m, of which so much is surely seen."""


class ControllerLimits:
    """Follows commands and torques sample by sample. lateness: of the commands."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        """values: parameters of the controller node."""
        self._error_limit, self._ft_limit = values["error_limit"], values["ft_limit"]
        self._longest = max(1, round(values["error_time"] * values["rate"]))
        self.lateness = Lateness(values["rate"], Tolerance(values["late_share"], values["late_time"]))
        self._off = self._idle = 0
        self._patience = max(1, round(OBEYED * values["rate"]))

    def clear(self) -> None:
        """Restart."""
        self.lateness.clear()
        self._off = self._idle = 0

    def idle(self, commanded: float, made: float) -> bool:
        """Return whether the motor makes no torque although one is commanded (N m): its driver has a fault.

        The torque commanded meanwhile must not act when the driver's fault is cleared.
        """
        self._idle = self._idle + 1 if abs(commanded) > SEEN and abs(made) < 0.2 * SEEN else 0
        if self._idle < self._patience:
            return False
        self._idle = 0
        return True

    def fault(self, ft: float, desired: float) -> str:
        """Return the fault that must end the torque, in words; empty without one.

        ft, desired: N m, of this sample.
        A sample with a small error cancels one with a large error, so a sine does not hide the error.
        """
        error = abs(ft - desired)
        self._off = max(0, self._off + (1 if error > self._error_limit else -1))
        if abs(ft) > self._ft_limit:
            return f"ft of {ft:.4g} N·m, expected at most ft_limit = {self._ft_limit:g} N·m"
        if self._off > self._longest:
            return (
                f"ft is {error:.4g} N·m off the desired torque, expected at most"
                f" error_limit = {self._error_limit:g} N·m for error_time"
            )
        if self.lateness.persists:
            tolerance = self.lateness.tolerance
            return (
                f"{self.lateness.count} commands more than {tolerance.late:g} sample late in the last"
                f" {tolerance.time:g} s, expected less than {100.0 * tolerance.share:.0f} % of them"
            )
        return ""
