"""Random and mutated byte strings into both receivers.

RDT does not check its values: the checksum of UDP must reject damage to them, which is not tried here.
"""

from __future__ import annotations

import argparse
import random
import struct
from pathlib import Path

from rsea_ros.hardware.dynamixel.frames import StatusFrameParser
from rsea_ros.hardware.netft.rdt import Sequence, decode
from rsea_ros.hardware.peer import protocol2


def fuzz(args: argparse.Namespace, folder: Path) -> list[tuple[str, str, str]]:
    """Feed both receivers; an exception ends the run."""
    accepted, wrong, undetectable = _frames(args.strings)
    records, strange = _records(args.strings)
    limit = f"a CRC of 16 bits misses {undetectable / 65536:.1f} of {undetectable}"
    return [
        (f"{args.strings} strings: packet receiver", "no exception", "none"),
        ("  accepted that the peer did not send", "0", f"{wrong}; {limit}; {accepted} whole ones were"),
        (f"{args.strings} strings: RDT receiver", "no exception", "none"),
        ("  accepted that were not sent", "0", f"{strange}; {records} whole ones were"),
    ]


def _frames(strings: int) -> tuple[int, int, int]:
    rng, accepted, wrong, blind = random.Random(1), 0, 0, 0
    for k in range(strings):
        packet = protocol2.status(1, 0, rng.randbytes(rng.choice((0, 3, 15, 16, 21))))
        damaged, same_length = _mutate(rng, packet) if k % 4 else (rng.randbytes(rng.randrange(60)), False)
        blind += same_length
        for frame in StatusFrameParser().feed(damaged):
            accepted += frame == packet
            wrong += frame != packet
    return accepted, wrong, blind


def _mutate(rng: random.Random, packet: bytes) -> tuple[bytes, bool]:
    """Return a damaged packet, and whether only its CRC can show it: several bytes changed."""
    kind = rng.randrange(5)
    at = rng.randrange(len(packet))
    if kind == 0:
        return packet[:at], False
    if kind == 1:
        return packet[:at] + packet[at + 1 :], False
    if kind == 2:
        return packet[:at] + rng.randbytes(rng.randrange(1, 4)) + packet[at:], True
    if kind == 3:
        return packet[:at] + bytes((packet[at] ^ 1 << rng.randrange(8),)) + packet[at + 1 :], False
    changed = bytearray(packet)
    for _ in range(rng.randrange(2, 5)):
        changed[rng.randrange(7, len(packet))] = rng.randrange(256)
    return bytes(changed), True


def _records(strings: int) -> tuple[int, int]:
    rng, sequence, accepted, strange = random.Random(2), Sequence(), 0, 0
    for k in range(1, strings + 1):
        whole = struct.pack(">3I6i", k, k, 0, *(rng.randrange(-(1 << 30), 1 << 30) for _ in range(6)))
        record = decode(whole)
        accepted += record is not None and sequence.accept(record)
        jump = bytearray(whole)
        jump[0] ^= 1 << rng.randrange(8)
        noise, cut = rng.randbytes(rng.randrange(80)), whole[: rng.randrange(36)]
        damaged = rng.choice((noise, rng.randbytes(36), cut, bytes(jump)))
        decoded = decode(damaged)
        strange += decoded is not None and sequence.accept(decoded)
    return accepted, strange
