"""An encoder on the spring behind the wire: it measures, and makes no torque."""

from __future__ import annotations

import math

from rsea_ros.hardware.peer.peer_motor import EmulatedMotor, Mechanism
from rsea_ros.hardware.peer.registers import ENCODER

IDENTITY = 100


class EmulatedEncoder(EmulatedMotor):
    """A device of the bus whose position is the deflection of the plant's spring."""

    def __init__(self, plant: Mechanism, origin: int = -777, kept: int = 0) -> None:
        super().__init__(ENCODER.number, plant, origin=origin, kept=kept)
        self.put("id", IDENTITY)

    def serve(self, now: int) -> None:
        """Do nothing: it has no torque that could be taken away."""

    def torque(self) -> float:
        """Return none."""
        return 0.0

    def _act(self, now: int) -> None:
        """Do nothing."""

    def _measure(self, now: int) -> None:
        turns = self._plant.read().deflection / (2 * math.pi)
        counts = round(turns * self.model.counts_per_turn)
        self.put("position", self._origin + self.get("homing_offset") + counts)
