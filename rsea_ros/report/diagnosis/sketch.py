"""A sketch of the bench from the command to the end that holds the spring, with the culprits marked."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.report import words

_PARTS = ("command", "motor", "gear", "encoder", "spring", "F/T sensor", "support")
_OF_PORT = {
    Port.COMMAND: "motor",
    Port.MOTOR: "motor",
    Port.GEAR: "gear",
    Port.SPRING: "spring",
    Port.SENSOR: "F/T sensor",
    Port.STRUCTURE: "gear",
}
_BOX, _HEIGHT = 104, 40
_ROW, _COLUMN = (128, 0), (0, 56)
"""From a part to the next one, side by side and, for phones, one below the other."""
_ANCHORS = {_PARTS[0]: ("start", 0), _PARTS[-1]: ("end", _BOX)}
"""Of the names below the outer parts, which the edge would otherwise cut off: anchor, and x in the part."""


def sketch(causes: Sequence[str]) -> str:
    """Return the drawing, empty without a cause. causes: names of effects, the largest first."""
    return _drawing(causes, "sketch", "900 92", _ROW)


def upright_sketch(causes: Sequence[str]) -> str:
    """Return the same drawing one part below the other, for screens as wide as a phone's."""
    return _drawing(causes, "upright sketch", f"344 {len(_PARTS) * _COLUMN[1] - 8}", _COLUMN)


def _drawing(causes: Sequence[str], kind: str, size: str, step: tuple[int, int]) -> str:
    if not causes:
        return ""
    marked = {part_of(effect_named(name)): name for name in reversed(causes)}
    boxes = "".join(_box(i, part, marked.get(part, ""), step) for i, part in enumerate(_PARTS))
    spoken = escape(", ".join(f"{name} at the {part}" for part, name in marked.items()))
    return (
        f'<svg class="{kind}" viewBox="0 0 {size}" role="img" aria-label="{spoken}">'
        f"<title>{spoken}</title>{boxes}</svg>"
    )


def part_of(effect: Effect) -> str:
    """Return the part of the bench that an effect sits in."""
    if effect.port == Port.SENSOR and effect.claims.channel in ("position", "velocity"):
        return "encoder"
    return effect.part if effect.part in _PARTS else _OF_PORT[effect.port]


def _box(index: int, part: str, culprit: str, step: tuple[int, int]) -> str:
    """Return a part with the line to the next one, in orange with its cause where it is to blame."""
    x, y = index * step[0] + 2, index * step[1] + 4
    text = f'x="{x + _BOX // 2}" y="{y + _HEIGHT // 2 + 5}"'
    link = "" if part == _PARTS[-1] else f"<line {_link(x, y, step)}/>"
    name = escape(words.effect(culprit)) if culprit else ""
    under = f'<text class="cause" {_beside(part, x, y, step)}>{name}</text>' if culprit else ""
    return (
        f'<g class="{"culprit" if culprit else "part"}">{link}'
        f'<rect x="{x}" y="{y}" width="{_BOX}" height="{_HEIGHT}" rx="6"/>'
        f"<text {text}>{escape(part)}</text>{under}</g>"
    )


def _link(x: int, y: int, step: tuple[int, int]) -> str:
    """Return the ends of the line from a part at x, y to the next one."""
    if step == _ROW:
        return f'x1="{x + _BOX}" x2="{x + step[0]}" y1="{y + _HEIGHT // 2}" y2="{y + _HEIGHT // 2}"'
    return f'x1="{x + _BOX // 2}" x2="{x + _BOX // 2}" y1="{y + _HEIGHT}" y2="{y + step[1]}"'


def _beside(part: str, x: int, y: int, step: tuple[int, int]) -> str:
    """Return where the name of a cause is drawn: under its part in a row, right of it in a column."""
    if step == _COLUMN:
        return f'x="{x + _BOX + 10}" y="{y + _HEIGHT // 2 + 5}" style="text-anchor:start"'
    anchor, at = _ANCHORS.get(part, ("middle", _BOX / 2))
    return f'x="{x + at:g}" y="{y + _HEIGHT + 24}" style="text-anchor:{anchor}"'
