"""Damage without regard to the format: bits, blocks, lengths, ends."""

from __future__ import annotations

import random
import struct

ODD_NUMBERS = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)
ODD_DOUBLES = (
    float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 1e-300, 0.0, -0.0, 1e30, 1e31,
)  # fmt: skip


def damage_bytes(rng: random.Random, data: bytes, other: bytes = b"") -> bytes:
    """Return bytes with one or a few places changed. other: bytes that may be spliced in."""
    for _ in range(rng.choice((1, 1, 1, 2, 4, 16))):
        data = rng.choice(_KINDS)(rng, data, other) if data else rng.randbytes(8)
    return data


def _flip(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes((data[at] ^ 1 << rng.randrange(8),)) + data[at + 1 :]


def _byte(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes((rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256))),)) + data[at + 1 :]


def _number(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Put an odd whole number or double at a place, as lengths, counts, stamps and values are."""
    at = rng.randrange(len(data))
    width, order = rng.choice((2, 4, 4, 8)), rng.choice("<<<>")
    if width == 8 and rng.random() < 0.5:
        put = struct.pack(f"{order}d", rng.choice(ODD_DOUBLES))
    else:
        code = {2: "H", 4: "I", 8: "Q"}[width]
        put = struct.pack(f"{order}{code}", rng.choice(ODD_NUMBERS) & (1 << 8 * width) - 1)
    return data[:at] + put + data[at + width :]


def _cut(rng: random.Random, data: bytes, other: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def _drop(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.choice((1, 2, 4, 8, 64, 512)) :]


def _insert(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice((1, 2, 4, 8, 64))) + data[at:]


def _repeat(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at, size = rng.randrange(len(data)), rng.choice((1, 4, 16, 256, 4096))
    return data[: at + size] + data[at : at + size] * rng.choice((1, 1, 3, 50)) + data[at + size :]


def _blank(rng: random.Random, data: bytes, other: bytes) -> bytes:
    at, size = rng.randrange(len(data)), rng.choice((4, 16, 256, 4096))
    return data[:at] + bytes((rng.choice((0, 0xFF)),)) * min(size, len(data) - at) + data[at + size :]


def _splice(rng: random.Random, data: bytes, other: bytes) -> bytes:
    other = other or data
    return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]


_KINDS = (_flip, _flip, _byte, _number, _number, _number, _cut, _drop, _insert, _repeat, _blank, _splice)
