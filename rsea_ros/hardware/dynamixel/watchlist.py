"""The registers that the torque hangs on, read again and again in spare cycles."""

from __future__ import annotations

import time

from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.dynamixel.bus import Bus
from rsea_ros.hardware.dynamixel.control_tables import Item

LOOK = 0.8
"""s in which each register is looked at once; a fault is latched within a second."""


class Watchlist:
    """Registers of one motor and the values that they shall have."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._expected: tuple[tuple[str, Item, int], ...] = ()
        self._looks, self._looked = 0, 0.0

    def expect(self, *registers: tuple[str, Item, int]) -> None:
        """Set the expected registers from now on: name, item, value; empty: nothing is checked."""
        self._expected = registers

    def look(self) -> str:
        """Read one of them in turn, each once in LOOK; return its fault.

        A lost reply is ignored: the register is read again later.
        """
        now = time.monotonic()
        if not self._expected or now - self._looked < LOOK / len(self._expected):
            return ""
        name, item, expected = self._expected[self._looks % len(self._expected)]
        self._looked = now
        try:
            value = self._bus.get(item)
        except NoReply:
            return ""
        self._looks += 1
        return "" if value == expected else f"{name} is {value}, expected {expected}"
