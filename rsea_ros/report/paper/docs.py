"""The figures of docs/derivation.md, still drawings: `rsea paper --figures docs/figures` makes them."""

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.rival_models import lumped_rig, readings
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, INK, QUIET, TRUTH
from rsea_ros.report.figures.response_curves import Mark, ResponseCurve
from rsea_ros.report.paper.figures import circuit, end_response, end_to_end_curves, prototype_band

_HZ: FloatArray = np.geomspace(0.1, 140.0, 240)
_WIDTH, _HEIGHT = 760.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 56.0, 190.0, 30.0, 44.0


def documentation_figures() -> dict[str, str]:
    """Return SVG by file name."""
    rig = load_rig("paper_high_impedance")
    apart = lumped_rig(rig)
    clamped = {
        "T_d/T_m, both models": (AFTER, rig, outputs.distal(rig, "element")),
        "T_p/T_m, lumped": (BEFORE, apart, outputs.proximal(apart)),
        "T_p/T_m, unlumped": (TRUTH, rig, outputs.proximal(rig)),
    }
    parts = [ResponseCurve(n, c, _HZ, frequency_response(of, y, _HZ)) for n, (c, of, y) in clamped.items()]
    models = readings(load_rig("paper_moving_output")).items()
    moving = [
        ResponseCurve(name, colour, _HZ, end_response(model, _HZ))
        for (name, model), colour in zip(models, (AFTER, TRUTH, BEFORE), strict=True)
    ]
    hz: FloatArray = np.geomspace(1.0, 300.0, 400)
    band, looks = prototype_band(), ((BEFORE, "solid"), (TRUTH, "solid"))
    ends, edges = end_to_end_curves(
        hz, "Eq. (6)", "spin, ", looks, ("start", "end"), Mark(band, f"{band:.1f} Hz")
    )
    resonances = [Mark(1.34, "1.34 Hz"), Mark(6.07, "6.1 Hz"), Mark(19.8, "19.8 Hz")]
    return {
        "general_circuit.svg": _on_white(circuit("general")),
        "epicyclic_circuit.svg": _on_white(circuit("epicyclic")),
        "clamped.svg": gain_svg(parts, (-60.0, 20.0), [Mark(6.37, "6.4 Hz")]),
        "moving_output.svg": gain_svg(moving, (-70.0, 10.0), resonances),
        "end_to_end.svg": gain_svg(ends, (-40.0, 40.0), edges),
    }


def _on_white(svg: str) -> str:
    """Return a drawing that can be read on a dark page too."""
    return svg.replace('style="', 'style="background:#ffffff;', 1) + "\n"


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
