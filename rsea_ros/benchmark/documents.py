"""JSON files of the benchmark, with errors that name the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rsea_ros.documents.wording import no_utf_8, quote
from rsea_ros.errors import BenchmarkError

text_of = quote


def read_text(path: Path) -> str:
    """Return the text of a file. Raises BenchmarkError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise BenchmarkError(f"{path}: {error.strerror}, expected a file that can be read") from None
    except UnicodeDecodeError as error:
        raise BenchmarkError(f"{path}: {no_utf_8(error)}, expected JSON") from None


def read_json(path: Path) -> dict[str, Any]:
    """Return the object of a JSON file."""
    return json_object(read_text(path), str(path))


def json_object(text: str, where: str) -> dict[str, Any]:
    """Return the object that a text is in JSON. Raises BenchmarkError for anything else."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        reason = error.msg if isinstance(error, json.JSONDecodeError) else type(error).__name__
        raise BenchmarkError(f"{where}: {reason}, expected JSON") from None
    if not isinstance(value, dict):
        raise BenchmarkError(f"{where}: {quote(value)}, expected a JSON object")
    return value
