"""Frames of Dynamixel Protocol 2.0, and a stream of bytes cut into them.

Source: Dynamixel Protocol 2.0 of the maker. Pure functions of bytes, no port.
"""

from collections import Counter
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


SHORTEST = 4
"""LEN of a status without parameters: INST, error, CRC."""
HIGHEST_ID = 252
BROADCAST = 254
"""Sender of the joint reply to a fast read."""
ERROR_CODES = frozenset(range(8))
"""Of the error byte, the bits below the alert."""


class StatusFrameParser:
    """Take bytes as they come and give out each whole, intact status frame once, unstuffed.

    rejected: how many frames were not, by kind: `crc`, `stuffing`, `length`, `instruction`.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.rejected: Counter[str] = Counter()

    def reset(self) -> None:
        """Forget a frame that has begun."""
        self._buffer.clear()

    @property
    def waiting(self) -> int:
        """Bytes of a frame that is not whole yet."""
        return len(self._buffer)

    def feed(self, data: bytes, raw: bool = False) -> list[bytes]:
        """Return the frames that these bytes complete, header to CRC. raw: fast replies are not stuffed."""
        self._buffer += data
        frames = []
        while (size := self._size()) is not None:
            frame = self._check(bytes(self._buffer[:size]), raw)
            if frame is None:
                del self._buffer[:1]  # search for a header inside the rejected frame
            else:
                frames.append(frame)
                del self._buffer[:size]
        return frames

    def _size(self) -> int | None:
        """Drop the bytes before a header; return the size of the frame behind it once it is whole."""
        buffer = self._buffer
        while True:
            at = buffer.find(HEADER)
            if at < 0:
                del buffer[: max(0, len(buffer) - len(HEADER) + 1)]
                return None
            del buffer[:at]
            if len(buffer) < OVERHEAD:
                return None
            length = int.from_bytes(buffer[5:7], "little")
            if SHORTEST <= length <= LONGEST - OVERHEAD:
                return length + OVERHEAD if len(buffer) >= length + OVERHEAD else None
            self.rejected["length"] += 1
            del buffer[:1]

    def _check(self, frame: bytes, raw: bool) -> bytes | None:
        """Return an intact status frame with its payload unstuffed."""
        if crc16(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
            self.rejected["crc"] += 1
            return None
        payload: bytes | None = frame[OVERHEAD:-2]
        if not raw:
            payload = unstuff(frame[OVERHEAD:-2])
        if payload is None:
            self.rejected["stuffing"] += 1
            return None
        if payload[0] != STATUS or not _possible(frame[4], payload[1]):
            self.rejected["instruction"] += 1
            return None
        length = (len(payload) + 2).to_bytes(2, "little")
        return frame[:5] + length + payload + frame[-2:]


def _possible(identity: int, error: int) -> bool:
    return (identity <= HIGHEST_ID or identity == BROADCAST) and error & 0x7F in ERROR_CODES
