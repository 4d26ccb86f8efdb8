"""A motor on a bus: what each is asked at open, before its torque comes on, after a fault and at the end."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TypeVar

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import NoReply, PortLost, State
from rsea_ros.hardware.limits import Limits, Rating
from rsea_ros.hardware.protection import ANSWER, BUS_WATCHDOG, Protection, Supervised

T = TypeVar("T")
ATTEMPTS = 5
"""Of a transaction outside the cycle."""
BOOT_TIME, BOOT_POLL = 5.0, 0.02
AS_CONFIGURED = "as it was at configure (another one needs cleanup and configure)"


def repeat(transaction: Callable[[], T]) -> T:
    """Return the result of a transaction, repeated when a reply is lost."""
    for _ in range(ATTEMPTS - 1):
        with suppress(NoReply):
            return transaction()
    return transaction()


class Unwrapper:
    """Counts of an encoder that go on where they begin anew, after `period` of them."""

    def __init__(self, period: int = 1 << 32) -> None:
        self._period = period
        self._last: int | None = None

    def restart(self) -> None:
        """Take the next counts as they are."""
        self._last = None

    def take(self, counts: int) -> int:
        """Return the counts nearest to the last ones, modulo the period."""
        last, half = counts if self._last is None else self._last, self._period // 2
        self._last = last + (counts - last + half) % self._period - half
        return self._last


class BusMotor(ABC):
    """One motor of some protocol. name: in messages, with its ID and port.

    protection: the motor's own watchdog, or a supervisor for a motor without; known once it is open.
    _owes_zero: whether it has not acknowledged that it is off since it was switched on.
    acknowledged_late: whether the reply to a write that raised NoReply arrived during the last reading.
    """

    acknowledged_late = False

    def __init__(self, name: str, watchdog: float, supervisor: str, wraps: int = 1 << 32) -> None:
        """watchdog, supervisor: as of MotorConnection. wraps: counts after which the angle begins anew."""
        self.name, self._counts = name, Unwrapper(wraps)
        self.protection: Protection | Supervised = Supervised(watchdog, supervisor)
        self._known: Mapping[str, object] | None = None
        self._owes_zero = False

    def open(self) -> None:
        """Open the port, check who answers, switch the torque off, set torque mode, read the limits.

        Its position counts anew.
        """
        self._counts.restart()
        self._known = None
        self._set_up()
        self._owes_zero = False

    def enable(self) -> None:
        """Switch the torque on, at zero, with a watchdog. Raises DeviceError, also for another motor."""
        self._owes_zero = True
        self._switch_on()

    def disable(self) -> None:
        """Command zero torque and switch it off."""
        if self._is_set_up():
            self._stop()
            self._owes_zero = False

    def recover(self) -> None:
        """Open the port again if it is lost, and see that it is the same motor, torque off.

        Raises DeviceError, also while the motor reports a hardware error.
        """
        try:
            if not self._is_set_up():
                raise NoReply(f"{self.name}: it was away when the port was opened again")
            self.patiently(self._ping)
        except DeviceError:
            self._let_go()
            self._set_up()
        else:
            self._identify()
        self._owes_zero = False
        self._supervise()
        if error := self._complaint():
            raise DeviceError(f"motor: hardware error {error}, expected a reboot first")

    def reboot(self) -> None:
        """Reboot the motor and set it up again. Raises DeviceError when it does not come back."""
        self.disable()
        self._restart()
        deadline = time.monotonic() + BOOT_TIME
        while True:
            time.sleep(BOOT_POLL)
            try:
                self._ping()
                break
            except NoReply:
                if time.monotonic() > deadline:
                    raise
        self._let_go()
        self._set_up()

    def close(self) -> None:
        """Zero torque, off, port closed. Raises DeviceError where torque may be on that nothing else ends.

        That is a motor without a watchdog, which is away: its supervisor has only the port that was lost.
        """
        self._let_go()
        if self._owes_zero and isinstance(self.protection, Supervised):
            with suppress(DeviceError):
                self._set_up()
            self._let_go()
            if self._owes_zero:
                raise DeviceError(f"{self.name}: it has not acknowledged zero torque, cut its power")

    def _let_go(self) -> None:
        """Zero torque, off, port closed; what is not acknowledged the supervisor tries, on no lost port."""
        lost = False
        try:
            self.disable()
        except DeviceError as error:
            lost = isinstance(error, PortLost)
        finally:
            if isinstance(self.protection, Supervised):  # the cycles of all joints wait meanwhile
                self.protection.release(safe=not self._owes_zero, patience=0.0 if lost else ANSWER)
            self._end()

    def _check_same(self, found: Mapping[str, object]) -> None:
        """Raise DeviceError where something is not as at `open`."""
        known = self._known or found
        if changed := [name for name in found if found[name] != known[name]]:
            words = "; ".join(f"{name} {found[name]}, expected {known[name]}" for name in changed)
            raise DeviceError(f"{self.name}: {words}, {AS_CONFIGURED}")

    @property
    @abstractmethod
    def rating(self) -> Rating:
        """What the motor can do at most."""

    @property
    def _watched(self) -> bool:
        """Whether the motor has a watchdog of its own."""
        return self.protection.kind == BUS_WATCHDOG

    @property
    def torque_limit(self) -> float:
        """The motor's own, N m."""
        return self.rating.torque

    @abstractmethod
    def check(self, limits: Limits) -> None:
        """Compare the driver's limits with the motor's own. Raises ParameterError."""

    @abstractmethod
    def read(self, meanwhile: Callable[[], None] | None = None) -> State:
        """Read all measurements once. Raises NoReply, PortLost. meanwhile: done while the reply is coming.

        stamp: of the middle of the transaction, monotonic, ns. position: without a wrap.
        """

    @abstractmethod
    def write(self, torque: float) -> None:
        """Command a torque (N m). Raises NoReply, PortLost."""

    @abstractmethod
    def patiently(self, transaction: Callable[[], T]) -> T:
        """Return the result of a transaction outside the cycle, with several attempts and more time."""

    @abstractmethod
    def health(self) -> Mapping[str, object]:
        """Return errors of the bus by kind, and what describes the motor."""

    @abstractmethod
    def _set_up(self) -> None:
        """Do the work of `open`, also for a motor that was lost: it must be the same one then."""

    @abstractmethod
    def _identify(self) -> None:
        """Switch the torque off, compare motor and settings with those of `open`, set torque mode."""

    @abstractmethod
    def _switch_on(self) -> None:
        """Do the work of `enable`."""

    @abstractmethod
    def _is_set_up(self) -> bool:
        """Return whether the port is open, and the motor known."""

    @abstractmethod
    def _stop(self) -> None:
        """Command zero torque and switch it off. Raises DeviceError unless the motor acknowledges it."""

    @abstractmethod
    def _ping(self) -> None:
        """Raise NoReply where the motor does not answer at once."""

    @abstractmethod
    def _complaint(self) -> str:
        """Return the hardware errors of the motor, in words."""

    @abstractmethod
    def _restart(self) -> None:
        """Let the motor restart, its errors cleared."""

    @abstractmethod
    def _supervise(self) -> None:
        """Start a supervisor for a motor without a watchdog, and a new one for one that is dead."""

    @abstractmethod
    def _end(self) -> None:
        """Close the port."""
