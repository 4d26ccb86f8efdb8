"""Frames of Protocol 2.0: `FF FF FD 00 ID LEN_L LEN_H INST PARAM… CRC_L CRC_H`, LEN = parameters + 3.

Source: Dynamixel Protocol 2.0 of the maker. Pure functions of bytes, no port.
"""

from __future__ import annotations

from collections.abc import Iterable

HEADER = b"\xff\xff\xfd\x00"
STATUS = 0x55
OVERHEAD = 7
"""Bytes before INST."""
LONGEST = 1024
"""Bytes of the longest frame that is looked at."""
_PATTERN, _STUFFED = b"\xff\xff\xfd", b"\xff\xff\xfd\xfd"


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (0x8005 if crc & 0x8000 else 0)
        table.append(crc & 0xFFFF)
    return tuple(table)


_TABLE = _crc_table()


def crc16(data: Iterable[int], crc: int = 0) -> int:
    """Return the CRC-16 of bytes: polynomial 0x8005, start 0, no reflection."""
    for byte in data:
        crc = ((crc << 8) & 0xFF00) ^ _TABLE[(crc >> 8) ^ byte]
    return crc


def stuff(payload: bytes) -> bytes:
    """Return INST and parameters with an FD put after every FF FF FD, so that they hold no header."""
    return payload.replace(_PATTERN, _STUFFED)


def unstuff(payload: bytes) -> bytes | None:
    """Return the bytes before stuffing; None for bytes that `stuffed` never makes."""
    plain = payload.replace(_STUFFED, _PATTERN)
    return plain if stuff(plain) == payload else None


def frame(identity: int, payload: bytes) -> bytes:
    """Return the frame of INST and parameters, stuffed, with its CRC."""
    body = stuff(payload)
    head = HEADER + bytes((identity,)) + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc16(head).to_bytes(2, "little")
