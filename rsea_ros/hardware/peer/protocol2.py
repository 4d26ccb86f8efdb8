"""Protocol 2.0 as the motor sees it. Written apart from the driver's codec: bit by bit, byte by byte."""

from functools import cache
from typing import NamedTuple

PREAMBLE = (0xFF, 0xFF, 0xFD, 0x00)


class Request(NamedTuple):
    """An instruction packet: to whom, what, with which parameters; whole: CRC and stuffing are right."""

    identity: int
    instruction: int
    parameters: bytes
    whole: bool = True


def checksum(data: bytes) -> int:
    """Return the remainder of the bytes, as one long number, modulo x^16 + x^15 + x^2 + 1."""
    register = 0
    for byte in data:
        register = _remainder(register >> 8 ^ byte) ^ (register & 255) << 8
    return register


@cache
def _remainder(byte: int) -> int:
    """Return the remainder of byte · x^16."""
    rest = byte << 16
    for bit in range(23, 15, -1):
        if rest >> bit & 1:
            rest ^= 0x18005 << bit - 16
    return rest


def escape(payload: bytes) -> bytes:
    """Return a payload with FD repeated wherever it ends FF FF FD."""
    out = bytearray()
    for byte in payload:
        out.append(byte)
        if out[-3:] == b"\xff\xff\xfd":
            out.append(0xFD)
    return bytes(out)


def unescape(payload: bytes) -> bytes | None:
    """Return the payload before `escape`; None when FF FF FD stands without its FD."""
    out, doubled = bytearray(), False
    for byte in payload:
        if doubled and byte != 0xFD:
            return None
        if not doubled:
            out.append(byte)
        doubled = not doubled and out[-3:] == b"\xff\xff\xfd"
    return None if doubled else bytes(out)


def status(identity: int, error: int, parameters: bytes = b"", *, escaped: bool = True) -> bytes:
    """Return a status packet. escaped: whether it is stuffed, as it must be."""
    payload = bytes((0x55, error)) + parameters
    return _packet(identity, escape(payload) if escaped else payload)


def instruction(identity: int, code: int, parameters: bytes = b"") -> bytes:
    """Return an instruction packet, as a host sends it."""
    return _packet(identity, escape(bytes((code,)) + parameters))


def _packet(identity: int, payload: bytes) -> bytes:
    size = len(payload) + 2
    packet = bytes((*PREAMBLE, identity, size & 255, size >> 8)) + payload
    remainder = checksum(packet)
    return packet + bytes((remainder & 255, remainder >> 8))


class RequestParser:
    """Collects bytes into requests."""

    def __init__(self) -> None:
        self._heard = bytearray()

    def hear(self, data: bytes) -> list[Request]:
        """Return the requests that are complete now."""
        self._heard.extend(data)
        requests = []
        while (request := self._next()) is not None:
            requests.append(request)
        return requests

    def _next(self) -> Request | None:
        heard = self._heard
        while len(heard) >= 4 and tuple(heard[:4]) != PREAMBLE:
            heard.pop(0)
        if len(heard) < 10:
            return None
        end = 7 + heard[5] + 256 * heard[6]
        if len(heard) < end:
            return None
        packet = bytes(heard[:end])
        del heard[:end]
        right = checksum(packet[:-2]) == packet[-2] + 256 * packet[-1]
        payload = unescape(packet[7:-2]) if right else None
        if payload is None:
            return Request(packet[4], packet[7], b"", whole=False)
        return Request(packet[4], payload[0], payload[1:])
