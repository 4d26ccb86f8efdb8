"""Responses as a still drawing for the docs: SVG by hand, the same at every run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from rsea_ros.report import words
from rsea_ros.report.figures.palette import GRID, INK, QUIET
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve

_WIDTH, _HEIGHT = 760.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 56.0, 190.0, 30.0, 44.0


def gain_svg(
    responses: Sequence[ResponseCurve], decibel: tuple[float, float], marks: Sequence[Mark] = ()
) -> str:
    """Return gain in dB over frequency, each curve named in its colour on the right."""
    low, high = responses[0].hz[0], responses[0].hz[-1]

    def x(hz: float) -> float:
        return _LEFT + (_WIDTH - _LEFT - _RIGHT) * math.log(hz / low) / math.log(high / low)

    def y(db: float) -> float:
        return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (decibel[1] - db) / (decibel[1] - decibel[0])

    parts = [f'<rect width="{_WIDTH:g}" height="{_HEIGHT:g}" fill="#ffffff"/>']
    for db in np.arange(math.ceil(decibel[0] / 20) * 20, decibel[1] + 1, 20):
        parts.append(_stroke(_LEFT, y(db), x(high), y(db), GRID))
        parts.append(_text(words.minus(f"{db:.0f}"), _LEFT - 8, y(db) + 4, QUIET, "end"))
    for hz in (m * 10.0**d for d in range(-2, 4) for m in (1, 2, 5)):
        if 0.999 * low <= hz <= 1.001 * high:
            parts.append(_stroke(x(hz), y(decibel[0]), x(hz), y(decibel[1]), GRID))
            parts.append(_text(f"{hz:g}", x(hz), y(decibel[0]) + 18, QUIET, "middle"))
    for mark in marks:
        parts.append(
            _stroke(x(mark.hz), y(decibel[0]), x(mark.hz), y(decibel[1]), QUIET, 'stroke-dasharray="2 3"')
        )
        anchor = {"start": "start", "end": "end"}.get(mark.anchor, "middle")
        parts.append(_text(mark.text, x(mark.hz), _TOP - 8, QUIET, anchor))
    for i, r in enumerate(responses):
        db = np.clip(20.0 * np.log10(np.abs(r.values)), decibel[0], decibel[1])
        points = " ".join(f"{x(f):.1f},{y(v):.1f}" for f, v in zip(r.hz, db, strict=True))
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{r.colour}" stroke-width="{r.width:g}"/>'
        )
        parts.append(_text(r.name, x(high) + 12, _TOP + 12 + 20 * i, r.colour))
    parts.append(_text("frequency, Hz", 0.5 * (_LEFT + x(high)), _HEIGHT - 8, QUIET, "middle"))
    parts.append(_text("gain, dB", 8, _TOP - 10, QUIET))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" width="{_WIDTH:g}" '
        f'font-family="system-ui, sans-serif" font-size="13" fill="{INK}">{"".join(parts)}</svg>\n'
    )


def _stroke(x_1: float, y_1: float, x_2: float, y_2: float, colour: str, more: str = "") -> str:
    return f'<line x1="{x_1:.1f}" y1="{y_1:.1f}" x2="{x_2:.1f}" y2="{y_2:.1f}" stroke="{colour}" {more}/>'


def _text(text: str, x: float, y: float, colour: str, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}">{escape(text)}</text>'
