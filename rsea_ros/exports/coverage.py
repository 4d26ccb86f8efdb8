"""The parts of a rig that a target represents, and those that it leaves out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Said:
    """Something of a rig that the target has. how: in the target's terms."""

    name: str
    how: str


@dataclass(frozen=True)
class Unsaid:
    """A part of a rig that the file leaves out. why: the feature that the target lacks."""

    name: str
    why: str


class CannotSay(Exception):
    """Raised by the translation of an effect that the target has no words for; the text says why."""


@dataclass(frozen=True)
class Export:
    """The file for a target, with exported and omitted parts. content: text or the bytes of an archive."""

    target: str
    suffix: str
    content: str | bytes
    said: tuple[Said, ...]
    unsaid: tuple[Unsaid, ...]


def coverage_lines(said: Iterable[Said], unsaid: Iterable[Unsaid]) -> list[str]:
    """Return both lists for people, a line each."""
    lines = [f"says {one.name}: {one.how}" for one in said]
    return [*lines, *(f"leaves out {one.name}: {one.why}" for one in unsaid)]
