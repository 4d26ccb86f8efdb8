"""One cycle of several joints, some of which share a bus."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Protocol

from rsea_ros.hardware.device import State

if TYPE_CHECKING:
    from rsea_ros.hardware.guarded import GuardedDevice


class Shared(Protocol):
    """A bus whose devices are written and read in one transaction."""

    def exchange(self) -> None:
        """Send written values, and fetch those to be read."""

    def send(self) -> None:
        """Send written values."""


def cycle(
    joints: Sequence[GuardedDevice],
    wanted: Sequence[tuple[float, float | None]],
    buses: Sequence[Shared] = (),
) -> list[State | None]:
    """Write the torques of all joints, then read all; return the reading of each, None of one without.

    wanted: torque (N m) and age of its command (s) of each, see GuardedDevice. A reading that trips a fault
    zeroes that joint's torque at once, and a motor that may not obey is switched off. The write comes first,
    so that a command takes effect as near to the start of its cycle as can be. A joint whose device is being
    switched, cleared or rebooted is left out, and holds up no other.
    """
    with ExitStack() as kept:
        taken = [joint.take(kept) for joint in joints]
        before = [joint.fault for joint in joints]
        for joint, is_taken, (torque, age) in zip(joints, taken, wanted, strict=True):
            if is_taken:
                joint.write(torque, age)
        for bus in buses:
            bus.exchange()
        states = [joint.read() if is_taken else None for joint, is_taken in zip(joints, taken, strict=True)]
        for joint, is_taken, fault, (_, age) in zip(joints, taken, before, wanted, strict=True):
            if is_taken and joint.fault is not fault:
                joint.write(0.0, age)
        for bus in buses:
            bus.send()
        for joint, state in zip(joints, states, strict=True):
            if state is not None:
                joint.switch_off_if_due()
        return states
