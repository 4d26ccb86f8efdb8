"""The parts of a rig that a target represents, and those that it leaves out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Represented:
    """Something of a rig that the target has. how: in the target's terms."""

    name: str
    how: str


@dataclass(frozen=True)
class Omitted:
    """A part of a rig that the file leaves out. why: the feature that the target lacks."""

    name: str
    why: str


class Unrepresentable(Exception):
    """Raised by the translation of an effect that the target has no words for; the text says why."""


@dataclass(frozen=True)
class Export:
    """The file for a target, with exported and omitted parts. content: text or the bytes of an archive."""

    target: str
    suffix: str
    content: str | bytes
    represented: tuple[Represented, ...]
    omitted: tuple[Omitted, ...]


def coverage_lines(represented: Iterable[Represented], omitted: Iterable[Omitted]) -> list[str]:
    """Return both lists for people, a line each."""
    lines = [f"says {one.name}: {one.how}" for one in represented]
    return [*lines, *(f"leaves out {one.name}: {one.why}" for one in omitted)]
