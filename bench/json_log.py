"""A log of JSON lines: the outcomes of a long bench, so that the next run goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_log(log: Path) -> list[dict[str, Any]]:
    """Return the entries of a log; none if it does not exist."""
    return [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []


def append_to_log(log: Path, entry: Mapping[str, Any]) -> None:
    """Append an entry to a log, and make its folder if it is missing."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
