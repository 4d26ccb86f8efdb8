"""How a run came by its rig: a name or a file that the user gave, or the default."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RigChoice:
    """option: the rig as it was named, empty if a Rig was passed. is_default: the user named none."""

    option: str = ""
    is_default: bool = False
