"""Where a run took its rig and its data from: the user's options, or the defaults."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RigChoice:
    """option: the rig as it was named, empty if a Rig was passed. is_default: the user named none.

    topics, part: options of the call, such as --joint elbow, that say which topics and which part of the
    record were read; a command on the same bags needs them too.
    """

    option: str = ""
    is_default: bool = False
    topics: tuple[str, ...] = ()
    part: tuple[str, ...] = ()
