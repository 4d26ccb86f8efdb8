"""The three places where a bag may be compressed: the whole file, each chunk, each message."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from lz4.frame import decompress as lz4_decompress

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
ERRORS = (zstd.ZstdError, RuntimeError, EOFError)
"""What the decompressors raise for damaged input."""

CHUNK_FORMATS: Mapping[str, Callable[[bytes], bytes]] = {
    "": bytes,
    "zstd": zstd.decompress,
    "lz4": lz4_decompress,
}


def unpack_message(raw: bytes) -> bytes:
    """Return a message decompressed, if it is compressed: CDR never starts like a zstd frame."""
    return zstd.decompress(raw) if raw.startswith(ZSTD_MAGIC) else raw


def unpack_file(path: Path, directory: Path) -> Path:
    """Decompress `NAME.zstd` to `NAME` in a directory; return its path."""
    target = directory / path.stem
    with zstd.open(path, "rb") as packed, target.open("wb") as plain:
        shutil.copyfileobj(packed, plain)
    return target
