"""Misbehaviour of the simulated bench on request. Shares are probabilities for one packet."""

from __future__ import annotations

import operator
import random
from dataclasses import dataclass, field

HEAD, EQUAL = 9, 14
"""Bytes of a reply before its data; the longest, that of a ping, which two motors of one model send alike."""


@dataclass
class Misbehaviour:
    """drop, delay, corrupt, truncate, wrong_crc: shares of the motor's replies. late: of the delay, s.

    unstuffed, silent: whether. twin: whether a second motor of the same ID answers at the same time, with
    other measurements; a line that two drive is low where either is. ft_drop: share of the sensor's records;
    ft_silent: whether it sends none; ft_stuck: whether they repeat one value, while the counters go on.
    """

    drop: float = 0.0
    delay: float = 0.0
    late: float = 0.01
    corrupt: float = 0.0
    truncate: float = 0.0
    wrong_crc: float = 0.0
    unstuffed: bool = False
    silent: bool = False
    twin: bool = False
    ft_drop: float = 0.0
    ft_silent: bool = False
    ft_stuck: bool = False
    seed: int = 0
    done: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def happens(self, kind: str) -> bool:
        """Draw for a share or read a switch, and count the event."""
        setting = getattr(self, kind)
        if setting is False or setting == 0.0:
            return False
        if setting is True or self._random.random() < setting:
            self.done[kind] = self.done.get(kind, 0) + 1
            return True
        return False

    def damage(self, packet: bytes) -> bytes:
        """Return a reply as it goes onto the wire: empty when it is dropped."""
        if self.happens("silent") or self.happens("drop"):
            return b""
        if len(packet) > EQUAL and self.happens("twin"):
            twin = bytes(37 * at % 256 for at in range(len(packet) - HEAD))
            packet = packet[:HEAD] + bytes(map(operator.and_, packet[HEAD:], twin))
        if self.happens("wrong_crc"):
            packet = packet[:-1] + bytes((packet[-1] ^ 0x5A,))
        if self.happens("corrupt"):
            at = self._random.randrange(len(packet))
            packet = packet[:at] + bytes((packet[at] ^ (1 << self._random.randrange(8)),)) + packet[at + 1 :]
        if self.happens("truncate"):
            packet = packet[: self._random.randrange(1, len(packet))]
        return packet
