"""A drive with the MIT frame: each command is answered by a reading, in SI units.

A drive that is off is asked by the frame that switches it off: nothing that is sent then can move it.
"""

import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import cycle

from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.bus_motor import ATTEMPTS, BusMotor, T, repeat
from rsea_ros.hardware.device import NoReply, State
from rsea_ros.hardware.limits import Limits, Rating
from rsea_ros.hardware.mit_can.frames import RANGES, Feedback, Frame, drive_table, frames_of, value
from rsea_ros.hardware.mit_can.port import CanPort
from rsea_ros.hardware.protection import BUS_WATCHDOG, NONE, Protection, Supervised

PATIENCE = 0.02
"""s for an answer outside the cycle."""
TWINS = 3
"""Cycles in a row with more answers than commands that are a second drive of the same ID."""
ALIKE = 1e-3
"""Part of a range by which that of the drive may differ from that of the table."""


@dataclass(frozen=True)
class CanConnection:
    """interface, channel: of python-can. model: of drive_table. baud: bit/s. host: identifier of the replies,
    -1: the table's. latency: s from a command to its answer. watchdog, supervisor: as of MotorConnection.
    """

    channel: str
    model: str
    identity: int = 1
    interface: str = "socketcan"
    baud: int = 1_000_000
    host: int = -1
    latency: float = 1e-3
    watchdog: float = 0.1
    supervisor: str = ""


class MitMotor(BusMotor):
    """One drive. Raises ParameterError for a model or an ID that does not exist."""

    def __init__(self, settings: CanConnection) -> None:
        self._settings, self.table = settings, drive_table(settings.model)
        name, wraps = f"drive ID {settings.identity} on {settings.channel}", self.table.wraps or 1 << 32
        super().__init__(name, settings.watchdog, settings.supervisor, wraps)
        least, most = self.table.ids
        if not least <= settings.identity <= most:
            raise ParameterError(f"parameter id = {settings.identity}, expected {least} to {most}")
        self._frames = frames_of(self.table, settings.identity, settings.host)
        self.port = CanPort(settings.interface, settings.channel, settings.baud)
        self._latency = settings.latency
        self._open = self._on = self._asked = False
        self._sent = self._heard = self._owed = self._twins = 0
        self._registers: dict[str, float] = {}
        self._marks = cycle(self.table.registers)

    @property
    def rating(self) -> Rating:
        """The range of its torque, or what it is set to if that is less; the range of its speed; a count."""
        own = self._registers.get("torque_limit", math.inf)
        count = value(1, self.table.position, 16) - value(0, self.table.position, 16)
        return Rating(min(self.table.torque, own), self.table.velocity, count=count)

    def check(self, limits: Limits) -> None:
        """Compare the driver's limits with ranges and settings of the drive. Raises ParameterError."""
        hot = self._registers.get("temperature_limit", math.inf)
        for name, limit, most, unit, why in (
            ("velocity", limits.velocity, self.table.velocity, "rad/s", "the range of its frames"),
            ("temperature", limits.temperature, hot, "°C", "where the drive switches itself off"),
        ):
            if limit > most and math.isfinite(limit):
                raise ParameterError(
                    f"parameter {name}_limit = {limit:g} {unit}, expected at most {most:g} {unit}, {why}"
                    f" ({self.table.name})"
                )

    def _switch_on(self) -> None:
        self._identify()
        if self._watched:
            self._set("watchdog", max(1, round(self._settings.watchdog / self.table.watchdog_unit)))
        self._send(self._frames.command(0.0))  # what a drive keeps until it is on
        self._switch(on=True)

    def write(self, torque: float) -> None:
        """Command a torque (N m); a drive that is off is told so again. Raises NoReply, PortLost."""
        if not math.isfinite(torque):
            raise DeviceError(f"torque of {torque} N·m, expected a finite value")
        self._request(self._frames.command(torque) if self._on else self._frames.disable())

    def read(self, meanwhile: Callable[[], None] | None = None) -> State:
        """Return the answer to the last command, or to a request of its own. Raises NoReply, PortLost."""
        if not self._asked:
            self.write(0.0)
        self._asked = False
        if meanwhile is not None:
            meanwhile()
        feedback = self._newest(self._latency)
        table, counts = self.table, feedback.counts
        if table.wraps:
            counts = self._counts.take(counts)
        return State(
            stamp=(self._sent + self._heard) // 2,
            position=value(counts, table.position, 16),
            velocity=feedback.velocity,
            motor_torque=feedback.torque,
            temperature=feedback.temperature,
            hardware_error=feedback.error,
            motor_trouble="" if feedback.error else self._trouble(feedback),
        )

    def _trouble(self, feedback: Feedback) -> str:
        """Return what the drive should not do, in words."""
        if self._twins >= TWINS:
            return "more answers than commands: two drives have this ID, or it reports by itself"
        if feedback.state and (feedback.state == self.table.on) != self._on:
            return f"state is {feedback.state}, expected {self.table.on if self._on else 'off'}"
        if not self.table.wraps and feedback.counts in (0, 0xFFFF):
            return f"the angle is at the end of its range, ±{self.table.position:.4g} rad"
        return ""

    def patiently(self, transaction: Callable[[], T]) -> T:
        usual, self._latency = self._latency, max(self._latency, PATIENCE)
        try:
            return repeat(transaction)
        finally:
            self._latency = usual

    def health(self) -> Mapping[str, object]:
        values: dict[str, object] = {f"bus_{kind}": n for kind, n in self.port.errors.items()}
        settings = {f"drive_{name}": f"{number:g}" for name, number in self._registers.items()}
        return values | settings | {
            "motor": f"{self.table.family} {self.table.name}",
            "torque_limit_nm": f"{self.torque_limit:.4g}",
        }  # fmt: skip

    def _set_up(self) -> None:
        self.port.open()
        self._open = True
        self._identify()
        if "watchdog" in self._registers:
            self.protection = Protection(BUS_WATCHDOG, self._settings.watchdog)
        elif self.port.descriptor is None:
            self.protection = Protection(NONE)
        elif not isinstance(self.protection, Supervised):
            self.protection = Supervised(self._settings.watchdog, self._settings.supervisor)
        self._supervise()

    def _identify(self) -> None:
        """See BusMotor. Raises DeviceError for another drive, one of its ID too, and for other ranges."""
        self._stop()
        for _ in range(TWINS + 1):
            state = self.patiently(self.read)
        if self._twins >= TWINS:
            raise DeviceError(f"{self.name}: {state.motor_trouble or 'more answers than commands'}")
        found: dict[str, object] = {"model": self.table.name}
        if (frame := self._frames.identify()) is not None:
            found["number"] = self._ask(frame, self._frames.unique)
        self._registers = {name: number for name in self.table.registers
                           if (number := self._register(name)) is not None}  # fmt: skip
        found |= {name: n for name, n in self._registers.items() if name not in ("mode", "watchdog")}
        for name in RANGES:
            own, here = self._registers.get(name, getattr(self.table, name)), getattr(self.table, name)
            if abs(own - here) > ALIKE * here:
                raise DeviceError(
                    f"{self.name}: range of {name} ±{own:g}, expected ±{here:g} of {self.table.name}"
                    " (parameter can_model: another model, or a file with the ranges of the drive)"
                )
        self._check_same(found)
        self._known = found
        if self._registers.get("mode", self.table.mode) != self.table.mode:
            self._set("mode", self.table.mode)

    def _register(self, name: str) -> float | None:
        """Return a register, None of one that the drive does not tell."""
        with suppress(NoReply):
            return self._ask(self._frames.ask(name), self._frames.answer(name))
        return None

    def _set(self, name: str, number: int) -> None:
        """Write a register, and read it again. Raises DeviceError where it is not as written."""
        self._send(self._frames.tell(name, number), answers=self._frames.tell_is_answered)
        if (now := self._register(name)) != number:
            raise DeviceError(f"{self.name}: {name} is {now}, expected {number}")

    def _switch(self, *, on: bool) -> Feedback:
        """Switch the torque, until the state in the answer is that. Raises DeviceError."""
        self._on = False
        frame = self._frames.enable() if on else self._frames.disable()
        for _ in range(ATTEMPTS):
            feedback = self._ask_state(frame)
            if not self.table.on or (feedback.state == self.table.on) == on:
                self._on = on
                return feedback
            frame = self._frames.command(0.0) if on else frame
        state = feedback.error or feedback.state
        raise DeviceError(f"{self.name}: {state}, expected {self.table.on if on else 'its torque off'}")

    def _stop(self) -> None:
        self._on = False
        with suppress(NoReply):
            self._send(self._frames.command(0.0))
        self._switch(on=False)
        if self._watched:
            self._set("watchdog", 0)

    def _is_set_up(self) -> bool:
        return self._open

    def _ping(self) -> None:
        self.read()

    def _complaint(self) -> str:
        return self.patiently(self.read).hardware_error

    def _restart(self) -> None:
        if (frame := self._frames.clear()) is not None:
            self._send(frame)

    def _supervise(self) -> None:
        if isinstance(self.protection, Supervised) and (port := self.port).descriptor is not None:
            frames = [port.wire(frame) for frame in (self._frames.command(0.0), self._frames.disable())]
            replies = [port.wire(start, size, whole=False) for start, size in self._frames.acknowledgements()]
            self.protection.guard(port.descriptor, frames, replies)

    def _end(self) -> None:
        self._open = self._on = False
        self.port.close()

    def _send(self, frame: Frame, *, answers: int = 1) -> None:
        """Send a frame after all that has arrived is counted: readings that are late, or too many.

        answers: the readings that it is answered by.
        """
        late = more = 0
        while (heard := self.port.receive(0.0)) is not None:
            if self._frames.feedback(heard) is not None:
                late, more = (late + 1, more) if late < self._owed else (late, more + 1)
        self._owed -= late
        self.port.errors += {"stale": late, "twice": more}
        self._twins = self._twins + 1 if more else 0
        self.port.send(frame)
        self._sent, self._owed = time.monotonic_ns(), self._owed + answers

    def _request(self, frame: Frame) -> None:
        self._asked = False
        self._send(frame)
        self._asked = True

    def _newest(self, patience: float) -> Feedback:
        """Return the last of the readings that are owed, of those in time (s). Raises NoReply, PortLost.

        A reading has no number. After one that was lost a register is asked for, where there are any: what
        comes before its answer is all that was owed, and without that answer the reading may be an old one.
        """
        newest, deadline = None, self._sent + round(1e9 * patience)
        mark: Callable[[Frame], float | None] | None = None
        if self._owed > 1 and self.table.registers:
            register = next(self._marks)
            self.port.send(self._frames.ask(register))
            mark = self._frames.answer(register)

        def take(frame: Frame) -> Feedback | float | None:
            return self._frames.feedback(frame) or (mark(frame) if mark is not None else None)

        while self._owed > 0 or mark is not None:
            heard = self._hear(take, deadline)
            if heard is None:
                break
            if isinstance(heard, Feedback):
                newest, self._heard, self._owed = heard, time.monotonic_ns(), max(self._owed - 1, 0)
            else:
                self._owed, mark = 0, None
        if newest is None or mark is not None:
            raise self._lost(patience)
        self._owed = 0
        return newest

    def _ask_state(self, frame: Frame) -> Feedback:
        """Return the reading after a frame, outside the cycle. Raises NoReply, PortLost."""

        def transaction() -> Feedback:
            self._send(frame)
            return self._newest(max(PATIENCE, self._latency))

        return repeat(transaction)

    def _ask(self, frame: Frame, take: Callable[[Frame], T | None]) -> T:
        """Return what is taken from the answer to a frame, outside the cycle. Raises NoReply, PortLost."""
        patience = max(PATIENCE, self._latency)

        def transaction() -> T:
            self._send(frame, answers=0)
            answer = self._hear(take, self._sent + round(1e9 * patience))
            if answer is None:
                raise self._lost(patience)
            return answer

        return repeat(transaction)

    def _lost(self, patience: float) -> NoReply:
        self.port.errors["lost"] += 1
        return NoReply(f"{self.name}: no answer in {1e3 * patience:.3g} ms")

    def _hear(self, take: Callable[[Frame], T | None], deadline: int) -> T | None:
        """Return what is taken from the first frame that has it until an instant, None without."""
        while True:
            left = deadline - time.monotonic_ns()
            frame = self.port.receive(max(0.0, left / 1e9))
            if frame is not None and (taken := take(frame)) is not None:
                return taken
            if frame is not None and self._owed and self._frames.feedback(frame) is not None:
                self._owed -= 1
            if frame is None and left <= 0:
                return None
