"""A sketch of the bench from the command to the end that holds the spring, with the culprits marked."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.report.diagnosis import words

_PARTS = ("command", "motor", "gear", "encoder", "spring", "F/T sensor", "support")
_OF_PORT = {
    Port.COMMAND: "motor",
    Port.MOTOR: "motor",
    Port.GEAR: "gear",
    Port.SPRING: "spring",
    Port.SENSOR: "F/T sensor",
    Port.STRUCTURE: "gear",
}
_WIDTH, _STEP, _BOX, _HEIGHT = 900, 128, 104, 40
_ANCHORS = {_PARTS[0]: ("start", 0), _PARTS[-1]: ("end", _BOX)}
"""Of the names below the outer parts, which the edge would otherwise cut off: anchor, and x in the part."""


def sketch(causes: Sequence[str]) -> str:
    """Return the drawing, empty without a cause. causes: names of effects, the largest first."""
    if not causes:
        return ""
    marked = {part_of(effect_named(name)): name for name in reversed(causes)}
    boxes = "".join(_box(i, part, marked.get(part, "")) for i, part in enumerate(_PARTS))
    spoken = escape(", ".join(f"{name} at the {part}" for part, name in marked.items()))
    return (
        f'<div class="scroll"><svg class="sketch" viewBox="0 0 {_WIDTH} 92" role="img" aria-label="{spoken}">'
        f"<title>{spoken}</title>{boxes}</svg></div>"
    )


def part_of(effect: Effect) -> str:
    """Return the part of the bench that an effect sits in."""
    if effect.port == Port.SENSOR and effect.claims.channel in ("position", "velocity"):
        return "encoder"
    return effect.part if effect.part in _PARTS else _OF_PORT[effect.port]


def _box(index: int, part: str, culprit: str) -> str:
    """Return a part with the line to the next one, in orange with the cause beneath where it is to blame."""
    x, middle = index * _STEP + 2, _HEIGHT // 2 + 4
    centre, name = f"{x + _BOX / 2:g}", escape(words.effect(culprit) if culprit else "")
    is_last = part == _PARTS[-1]
    link = "" if is_last else f'<line x1="{x + _BOX}" x2="{x + _STEP}" y1="{middle}" y2="{middle}"/>'
    anchor, at = _ANCHORS.get(part, ("middle", _BOX / 2))
    place = f'x="{x + at:g}" y="{_HEIGHT + 28}" style="text-anchor:{anchor}"'
    under = f'<text class="cause" {place}>{name}</text>' if culprit else ""
    return (
        f'<g class="{"culprit" if culprit else "part"}">{link}'
        f'<rect x="{x}" y="4" width="{_BOX}" height="{_HEIGHT}" rx="6"/>'
        f'<text x="{centre}" y="{middle + 5}">{escape(part)}</text>{under}</g>'
    )
