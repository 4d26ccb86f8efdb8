"""Figures of a diagnosis: a sketch of the bench with the culprits marked, and, before and after, the residual
over frequency and the channel over time."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape

import numpy as np

from rsea_ros.diagnosis.result import Diagnosis, Spectrum
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.report import words
from rsea_ros.report.figures.figure import AFTER, BEFORE, Figure, band, faint
from rsea_ros.report.figures.overlay import Simulated, overlay_figure
from rsea_ros.report.figures.spectrum import ABOVE_FLOOR, SpectrumLine, finding, in_bands, residual_figure
from rsea_ros.report.page import Html

_FIRST_VIEW = 3.0
"""s of the record that the figure over time opens with."""


def spectrum_figure(diagnosis: Diagnosis, spectrum: Spectrum) -> Figure:
    """Return the residual's density before and after against the noise floor, the improvement shaded."""
    d, s, channel = diagnosis, spectrum, words.channel(spectrum.channel)
    if not d.causes:
        curves = [SpectrumLine("residual", AFTER if d.at_noise_floor else BEFORE, s.before)]
        title = finding(s.frequency, s.before, s.noise, channel)
        return residual_figure(title, s.channel, s.frequency, curves, s.noise)
    f, before = in_bands(s.frequency, s.before)
    _, after = in_bands(s.frequency, s.after)
    k, left = int(np.argmax(before)), int(np.argmax(after))
    most, rest = before[k] / s.noise, after[left] / s.noise
    peak = f"{words.number(most, 2)} times the noise floor at {words.number(f[k], 2)} Hz"
    end = f"at most {words.number(rest, 2)} times at {words.number(f[left], 2)} Hz"
    end = "it is at the floor" if rest < ABOVE_FLOOR else end
    causes = list_names([words.effect(c.name) for c in d.causes])
    they = "it" if len(d.causes) == 1 else "them"
    title = f"Without {causes} the residual is up to {peak}; with {they}, {end}"
    curves = [SpectrumLine("before", BEFORE, s.before), SpectrumLine("after", AFTER, s.after)]
    caption = f"Residual of the {channel}: measured minus simulated."
    figure = residual_figure(title, s.channel, s.frequency, curves, s.noise, caption)
    gained = band(f, np.minimum(after, before), before, faint(BEFORE, 0.10), name="gained")
    return replace(figure, data=[gained, *figure.data])


def time_figure(diagnosis: Diagnosis, channel: str) -> Figure:
    """Return the channel as measured and as simulated before and after, residuals beneath.

    With causes it opens where before and after differ most.
    """
    d = diagnosis
    before, after = (next(o for o in of if o.channel == channel) for of in (d.before, d.after))
    name, fit = words.sentence(words.channel(channel)), f"{d.fit_percent[channel]:.2f} %"
    if not d.causes:
        simulated = Simulated("simulated", AFTER if d.at_noise_floor else BEFORE, before.simulated)
        title = f"{name} over time: {fit} explained"
        return overlay_figure(title, channel, before.t, before.measured, [simulated])
    title = f"{name} over time: {fit} → {d.extended_fit_percent[channel]:.2f} % explained"
    both = [Simulated("before", BEFORE, before.simulated), Simulated("after", AFTER, after.simulated)]
    apart = before.simulated - after.simulated
    return overlay_figure(title, channel, before.t, before.measured, both, _FIRST_VIEW, apart)


_PARTS = ("command", "motor", "gear", "encoder", "spring", "F/T sensor", "support")
_OF_PORT = {
    Port.COMMAND: "motor", Port.MOTOR: "motor", Port.GEAR: "gear", Port.SPRING: "spring",
    Port.SENSOR: "F/T sensor", Port.STRUCTURE: "gear",
}  # fmt: skip
_BOX, _HEIGHT = 104, 40
_ROW, _COLUMN = 128, 56
"""From a part to the next one, side by side and, for phones, one below the other."""


def sketch(causes: Sequence[str]) -> Html:
    """Return the drawing, in a row and, for phones, in a column; empty without a cause.

    causes: names of effects, the largest first.
    """
    if not causes:
        return Html()
    marked = {part_of(effect_named(name)): name for name in reversed(causes)}
    spoken = escape(", ".join(f"{name} at the {part}" for part, name in marked.items()))
    drawings = []
    for kind, size in (("sketch", "900 92"), ("upright sketch", f"344 {len(_PARTS) * _COLUMN - 8}")):
        boxes = "".join(
            _box(i, part, marked.get(part, ""), kind != "sketch") for i, part in enumerate(_PARTS)
        )
        look = f'class="{kind}" viewBox="0 0 {size}" role="img" aria-label="{spoken}"'
        drawings.append(f"<svg {look}><title>{spoken}</title>{boxes}</svg>")
    return Html("".join(drawings))


def part_of(effect: Effect) -> str:
    """Return the part of the bench that an effect sits in."""
    if effect.port == Port.SENSOR and effect.claims.channel in ("position", "velocity"):
        return "encoder"
    return effect.part if effect.part in _PARTS else _OF_PORT[effect.port]


def _box(index: int, part: str, culprit: str, upright: bool) -> str:
    """Return a part with the line to the next one, in orange with its cause where it is to blame.

    The name of the cause stands under its part in a row, where the edge would cut off those of the outer
    parts if they were centred, and right of it in a column.
    """
    x, y = (2, index * _COLUMN + 4) if upright else (index * _ROW + 2, 4)
    middle, level = x + _BOX // 2, y + _HEIGHT // 2
    if upright:
        line, beside = (middle, middle, y + _HEIGHT, y + _COLUMN), (x + _BOX + 10, level + 5, "start")
    else:
        line, beside = (x + _BOX, x + _ROW, level, level), (middle, y + _HEIGHT + 24, "middle")
        if part in (_PARTS[0], _PARTS[-1]):
            beside = (x, beside[1], "start") if part == _PARTS[0] else (x + _BOX, beside[1], "end")
    link = '<line x1="{}" x2="{}" y1="{}" y2="{}"/>'.format(*line) if part != _PARTS[-1] else ""
    name = escape(words.effect(culprit)) if culprit else ""
    place = 'x="{}" y="{}" style="text-anchor:{}"'.format(*beside)
    under = f'<text class="cause" {place}>{name}</text>' if culprit else ""
    return (
        f'<g class="{"culprit" if culprit else "part"}">{link}'
        f'<rect x="{x}" y="{y}" width="{_BOX}" height="{_HEIGHT}" rx="6"/>'
        f'<text x="{middle}" y="{level + 5}">{escape(part)}</text>{under}</g>'
    )
