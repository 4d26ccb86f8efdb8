"""Where a result comes from: software, date, command line, and which files."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

from rsea_ros.version import version

_SHOWN = 12
"""Hexadecimal digits of a hash on a page; the result file has all of them."""


@dataclass(frozen=True)
class Provenance:
    """date: ISO 8601, UTC. files: SHA-256 in hexadecimal by path, as they were given."""

    version: str
    date: str
    command: str
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def lines(self) -> tuple[str, ...]:
        """The footer of a page."""
        hashes = [f"{path} (SHA-256 {digest[:_SHOWN]}…)" for path, digest in self.files.items()]
        return f"rsea_ros {self.version}, {self.date}: {self.command}", *hashes

    @property
    def json(self) -> dict[str, object]:
        """The entry in a result file."""
        return {
            "version": self.version,
            "date": self.date,
            "command": self.command,
            "sha256": dict(self.files),
        }


def provenance_of(command: Sequence[str], files: Iterable[str | Path]) -> Provenance:
    """Return the provenance of a result made now by a command line from some files or bags.

    Raises OSError for a file that cannot be read.
    """
    now = datetime.now(timezone.utc).isoformat(timespec="seconds")
    return Provenance(version(), now, shlex.join(command), {str(f): digest(f) for f in files})


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file; of a folder, that of its files in the order of their names."""
    path = Path(path)
    whole = hashlib.sha256()
    for part in sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]:
        with part.open("rb") as file:
            while block := file.read(1 << 20):
                whole.update(block)
    return whole.hexdigest()
