"""One motor of a line behind the Device interface, and the cycle of all of them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from rsea_ros.hardware.device import State
from rsea_ros.hardware.dynamixel.line import Line
from rsea_ros.hardware.dynamixel.sample import Sample
from rsea_ros.hardware.guarded import Guarded
from rsea_ros.hardware.protection import Protection


class Member:
    """A motor of an open line. Angles count from where it stands when this is opened."""

    def __init__(self, line: Line, identity: int) -> None:
        self._line, self._id, self._motor = line, identity, line.motors[identity]
        self._epoch, self._origin = 0, 0.0
        self._alone: Sample | None = None

    @property
    def protection(self) -> Protection:
        """The motor's."""
        return self._motor.protection

    def open(self) -> None:
        """Note zero of angle and time; the line is open."""
        self._epoch = time.time_ns() - time.monotonic_ns()
        with self._line.busy:
            self._origin = self._motor.bus.patiently(self._motor.read).position

    def enable(self) -> None:
        """Switch the torque on, at zero."""
        self._line.goals[self._id] = 0
        with self._line.busy:
            self._motor.enable()

    def read(self) -> State:
        """Return what the last exchange has brought, or a reading of its own. Raises NoReply, PortLost."""
        sample, self._alone = self._alone or self._line.sample(self._id), None
        return State(
            stamp=sample.instant + self._epoch,
            position=sample.position - self._origin,
            velocity=sample.velocity,
            motor_torque=self._motor.torque_of(sample.current),
            current=sample.current,
            voltage=sample.voltage,
            temperature=sample.temperature,
            hardware_error=sample.hardware_error,
            motor_trouble=sample.trouble,
        )

    def write(self, torque: float) -> None:
        """Set the goal (N m) that the next exchange writes."""
        self._line.goals[self._id] = self._motor.counts(torque)

    def disable(self) -> None:
        """Command zero torque and switch it off."""
        self._line.goals[self._id] = 0
        with self._line.busy:
            self._motor.disable()

    def zero_ft(self) -> None:
        """Have no F/T sensor."""

    def recover(self) -> None:
        """Connect again; where the port was lost, every motor of the line must be recovered."""
        self._line.goals[self._id] = 0
        with self._line.busy:
            if self._line.lost_port:
                self._line.reopen()
            self._motor.recover()
            self._alone = self._motor.bus.patiently(self._motor.read)  # what the next `read` asks for

    def reboot(self) -> None:
        """Reboot the motor; nobody of the line is heard meanwhile."""
        self._line.goals[self._id] = 0
        with self._line.busy:
            self._motor.reboot()

    def health(self) -> Mapping[str, object]:
        """Return what it is and what was lost."""
        name = self._motor.table.name if self._motor.table is not None else "unknown"
        return {"motor": name, "id": self._id, "bus_lost": self._line.lost[self._id]}

    def close(self) -> None:
        """Zero torque, off; the line stays open for the others."""
        self._line.goals[self._id] = 0
        with self._line.busy:
            self._motor.close()


def cycle(
    line: Line, members: Sequence[Guarded], wanted: Sequence[tuple[float, float | None]]
) -> list[State | None]:
    """Do one cycle of all motors of a line; return the reading of each.

    wanted: torque (N m) and age of its command (s) of each, see Guarded. A reading that trips a fault zeroes
    that motor's torque at once.
    """
    there = [not guarded.away for guarded in members]
    faults = [guarded.fault for guarded in members]
    for guarded, here, (torque, age) in zip(members, there, wanted, strict=True):
        if here:
            guarded.write(torque, age)
    line.exchange()
    states = [guarded.read() if here else None for guarded, here in zip(members, there, strict=True)]
    tripped = False
    for guarded, here, before, (_, age) in zip(members, there, faults, wanted, strict=True):
        if here and guarded.fault is not before:
            guarded.write(0.0, age)
            tripped = True
    if tripped:
        line.write()
    return states
