"""Chunks of the Blosc 1 container, zarr's default: blocks, each shuffled and compressed.

A chunk has a header of 16 bytes, the offset of each block, and the blocks: for each of its streams a length
and the stream, as it is where the length is that of the unpacked stream. Source: README_CHUNK_FORMAT of
c-blosc. An array of measurements often has one chunk that is far longer than the record: only the requested
part is unpacked.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from lz4 import block as lz4_block

from msg_adapters.compression import ERRORS, unpack_zstd

_HEADER = struct.Struct("<4B3I")
_LENGTH = struct.Struct("<I")
_VERSION = 2
_SHUFFLED, _COPIED, _BITS_SHUFFLED, _UNSPLIT, _CODEC = 0x01, 0x02, 0x04, 0x10, 5
_LARGEST_SPLIT, _SHORTEST_STREAM = 16, 128
"""A block is a stream for each byte of its numbers: of up to 16 bytes, and 128 numbers or more."""


def _lz4(packed: bytes, size: int) -> bytes:
    return bytes(lz4_block.decompress(packed, uncompressed_size=size))


def _zlib(packed: bytes, size: int) -> bytes:
    return zlib.decompressobj().decompress(packed, size)


_CODECS: Mapping[int, Callable[[bytes, int], bytes]] = {1: _lz4, 3: _zlib, 4: unpack_zstd}
_NAMES = ("blosclz", "lz4", "snappy", "zlib", "zstd")


@dataclass(frozen=True)
class _Chunk:
    """A chunk and its header. size, block: bytes that the chunk and each block unpack to."""

    packed: bytes
    flags: int
    width: int
    size: int
    block: int

    def streams(self, size: int) -> int:
        """Return how many streams a block of `size` bytes has; a shorter last one has one."""
        split = not self.flags & _UNSPLIT and size == self.block and self.width <= _LARGEST_SPLIT
        return self.width if split and size // self.width >= _SHORTEST_STREAM else 1


def unpack_blosc(packed: bytes, size: int, count: int) -> bytes:
    """Return the first `count` bytes of a chunk that unpacks to `size`.

    Raises ValueError for a damaged one.
    """
    try:
        chunk = _chunk(packed, size)
        if chunk.flags & _COPIED:
            return packed[_HEADER.size : _HEADER.size + count]
        blocks = range(-(-count // chunk.block))
        return b"".join(_block(chunk, number) for number in blocks)[:count]
    except (struct.error, zlib.error, lz4_block.LZ4BlockError, *ERRORS) as error:
        raise ValueError(f"a Blosc chunk cannot be unpacked ({error}); a damaged file?") from None


def _chunk(packed: bytes, size: int) -> _Chunk:
    version, _, flags, width, unpacked, block, held = _HEADER.unpack_from(packed)
    if version != _VERSION or held != len(packed) or unpacked != size or not (block and width):
        raise ValueError(
            f"a Blosc chunk of version {version} holds {held} bytes for {unpacked}, expected version"
            f" {_VERSION} and {len(packed)} bytes for {size}; a damaged file?"
        )
    if flags & _BITS_SHUFFLED:
        raise ValueError("a Blosc chunk has its bits shuffled, expected bytes shuffled or none")
    if not flags & _COPIED and flags >> _CODEC not in _CODECS:
        name = _NAMES[flags >> _CODEC] if flags >> _CODEC < len(_NAMES) else "an unknown codec"
        raise ValueError(f"a Blosc chunk is packed by {name}, expected lz4, zlib or zstd")
    return _Chunk(packed, flags, width, size, block)


def _block(chunk: _Chunk, number: int) -> bytes:
    size = min(chunk.block, chunk.size - number * chunk.block)
    (at,) = _LENGTH.unpack_from(chunk.packed, _HEADER.size + number * _LENGTH.size)
    streams = chunk.streams(size)
    parts = []
    for _ in range(streams):
        (length,) = _LENGTH.unpack_from(chunk.packed, at)
        at += _LENGTH.size
        parts.append(_stream(chunk, chunk.packed[at : at + length], size // streams))
        at += length
    return _unshuffle(b"".join(parts), chunk.width) if chunk.flags & _SHUFFLED else b"".join(parts)


def _stream(chunk: _Chunk, packed: bytes, size: int) -> bytes:
    part = packed if len(packed) == size else _CODECS[chunk.flags >> _CODEC](packed, size)
    if len(part) != size:
        raise ValueError(f"a Blosc stream unpacks to {len(part)} bytes, expected {size}; a damaged file?")
    return part


def _unshuffle(block: bytes, width: int) -> bytes:
    """Return the numbers of a block that holds all their first bytes, then all their second ones, …"""
    whole = len(block) - len(block) % width
    numbers = np.frombuffer(block[:whole], np.uint8).reshape(width, -1).T
    return bytes(numbers.tobytes()) + block[whole:]
