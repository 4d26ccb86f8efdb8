"""YAML of unknown origin: every scalar stays text, nothing is expanded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from rsea_ros.documents.wording import brief, no_utf_8
from rsea_ros.errors import BagError

LARGEST = 1_000_000
DEEPEST = 30

_Loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


class NotUnderstood(ValueError):
    """A document of another form than expected, in words for people."""


def load(path: Path) -> Any:
    """Return the document of a file. Raises as `document` does, and FileNotFoundError."""
    with path.open("rb") as file:
        return document(path, file.read(LARGEST + 1))


def document(path: Path, data: bytes) -> Any:
    """Return the YAML content of a file as mappings, lists and texts.

    Raises BagError for more than 1 MB, aliases, and deep nesting; NotUnderstood for other text.
    """
    if len(data) > LARGEST:
        raise BagError(f"{path}: more than {LARGEST} bytes, expected the metadata of a bag")
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise NotUnderstood(no_utf_8(error)) from None
    try:
        _check(path, text)
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise NotUnderstood(brief(" ".join(str(error).split()))) from None


def _check(path: Path, text: str) -> None:
    depth = 0
    for event in yaml.parse(text, _Loader):
        if isinstance(event, yaml.AliasEvent):
            raise BagError(f"{path}: has an alias (*{brief(str(event.anchor))}), expected none")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise BagError(f"{path}: nested more than {DEEPEST} deep, expected the metadata of a bag")
