"""The three places where a bag may be compressed: the whole file, each chunk, each message.

A few bytes may unpack to any number of gigabytes. So every file has an allowance, in
proportion to its size, and nothing is unpacked beyond it or beyond the declared size.
"""

import sys
from pathlib import Path
from typing import Any

from lz4.frame import LZ4FrameDecompressor

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
ERRORS = (zstd.ZstdError, RuntimeError, EOFError)
"""What the decompressors raise for damaged input."""

COMPRESSIONS = ("", "zstd", "lz4")
RATIO = 200
"""Times its packed size: measurements with their stamps reach 20, blank images more."""
SLACK = 64 << 20
"""Bytes that are allowed whatever the packed size."""
_BLOCK = 1 << 20


class Allowance:
    """Bytes that a file of some packed size may still unpack to."""

    def __init__(self, packed: int) -> None:
        self._limit = self.left = SLACK + RATIO * packed

    def take(self, count: int) -> None:
        """Use up a part of the allowance. Raises ValueError when that is more than the rest."""
        if count > self.left:
            raise ValueError(
                f"unpacks to more than {self._limit} bytes, expected at most {RATIO} times its size"
            )
        self.left -= count


def unpack_chunk(compression: str, packed: bytes, declared: int, allowance: Allowance) -> bytes:
    """Return the records of a chunk. Raises ValueError (or one of ERRORS) where they are not as declared."""
    if compression not in COMPRESSIONS:
        raise ValueError(f"compression {compression[:20]!r}, expected none, zstd or lz4")
    if not compression:
        return packed
    allowance.take(declared)
    decompressor = zstd.ZstdDecompressor() if compression == "zstd" else LZ4FrameDecompressor()
    records = _one_frame(decompressor, packed, declared)
    if len(records) != declared:
        raise ValueError(f"unpacks to {len(records)} bytes, expected the {declared} that it declares")
    return records


def unpack_message(raw: bytes, allowance: Allowance) -> bytes:
    """Return a message decompressed, if it is compressed: CDR never starts like a zstd frame."""
    if not raw.startswith(ZSTD_MAGIC):
        return raw
    message = _one_frame(zstd.ZstdDecompressor(), raw, allowance.left)
    allowance.take(len(message))
    return message


def unpack_file(path: Path, directory: Path) -> Path:
    """Decompress `NAME.zstd` to `NAME` in a directory; return its path."""
    target = directory / path.stem
    allowance = Allowance(path.stat().st_size)
    with zstd.open(path, "rb") as packed, target.open("wb") as plain:
        while block := packed.read(_BLOCK):
            allowance.take(len(block))
            plain.write(block)
    return target


def _one_frame(decompressor: Any, packed: bytes, most: int) -> bytes:
    """Unpack one frame, to one byte more than it may have at the most."""
    plain: bytes = decompressor.decompress(packed, max_length=most + 1)
    if len(plain) > most:
        raise ValueError(f"unpacks to more than {most} bytes, which is all that it may")
    has_more = not decompressor.eof and len(plain) == most and decompressor.decompress(b"", max_length=1)
    if has_more or not decompressor.eof:
        raise ValueError(f"its compressed data break off after {len(plain)} bytes")
    return plain
