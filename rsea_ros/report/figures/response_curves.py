"""Gain and phase of several responses with marks where the paper says a number."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import ComplexArray, FloatArray
from rsea_ros.report.figures import figure as fig


@dataclass(frozen=True)
class Band:
    """Limits about a curve at hz, shape (n,): least and largest gain, dB, and phase, deg."""

    hz: FloatArray
    gain: tuple[FloatArray, FloatArray]
    phase: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class ResponseCurve:
    """A curve: name in the legend at its end, hz and values of shape (n,).

    phase: deg, shape (n,); by default that of the values, continuous from the first.
    """

    name: str
    colour: str
    hz: FloatArray
    values: ComplexArray
    width: float = 1.8
    dash: str = "solid"
    band: Band | None = None
    phase: FloatArray | None = None

    @property
    def degrees(self) -> FloatArray:
        """The phase that is drawn, deg, shape (n,)."""
        return np.degrees(np.unwrap(np.angle(self.values))) if self.phase is None else self.phase


@dataclass(frozen=True)
class Mark:
    """A frequency, Hz, its text, and the side of the text at the line."""

    hz: float
    text: str
    anchor: str = "center"


def response_figure(
    title: str, responses: Sequence[ResponseCurve], marks: Sequence[Mark] = (), caption: str = "",
    decibel: tuple[float, float] | None = None,
) -> fig.Figure:  # fmt: skip
    """Return gain and phase over frequency; marks are vertical lines. decibel: range of the gain axis."""
    data: list[fig.Json] = []
    for r in responses:
        if r.band is not None:
            shade = fig.faint(r.colour, 0.18)
            data.append(fig.band(r.band.hz, *r.band.gain, shade))
            data.append(fig.band(r.band.hz, *r.band.phase, shade, yaxis="y2"))
        gain = 20.0 * np.log10(np.abs(r.values))
        parts: fig.Json = {"line": {"color": r.colour, "width": r.width, "dash": r.dash}}
        data.append(fig.line(r.hz, gain, r.name, r.colour, hovertemplate="%{y:.2f} dB", **parts))
        parts |= {"hovertemplate": "%{y:.1f}°", "yaxis": "y2"}
        data.append(fig.line(r.hz, r.degrees, r.name, r.colour, **parts))
    return fig.Figure(title, caption, data, _layout(responses, marks, decibel), 560)


def _layout(
    responses: Sequence[ResponseCurve], marks: Sequence[Mark], decibel: tuple[float, float] | None
) -> fig.Json:
    low, high = min(r.hz[0] for r in responses), max(r.hz[-1] for r in responses)
    turned = [np.ptp(r.degrees) for r in responses]
    turned += [np.ptp(np.concatenate(r.band.phase)) for r in responses if r.band is not None]
    tick = 90.0 if max(turned) <= 720.0 else 180.0  # not more than eight marks
    notes = [
        fig.label(
            m.text, float(np.log10(m.hz)), 1.0, fig.QUIET, yref="paper", yanchor="bottom", xanchor=m.anchor
        )
        for m in marks
    ]
    stroke: fig.Json = {"type": "line", "xref": "x", "yref": "paper"}
    style = {"color": fig.QUIET, "width": 1, "dash": "dot"}
    gain = fig.axis("gain, dB", domain=[0.44, 1.0])
    return fig.layout(
        xaxis=fig.frequency_axis(low, high, anchor="y2"),
        yaxis={**gain, "range": list(decibel)} if decibel else gain,
        yaxis2=fig.axis("phase, °", domain=[0.0, 0.36], dtick=tick),
        annotations=[*fig.names_beside([(r.name, r.colour) for r in responses], 0.075), *notes],
        shapes=[{**stroke, "x0": m.hz, "x1": m.hz, "y0": 0.0, "y1": 1.0, "line": style} for m in marks],
        hoversubplots="axis",
        margin={"l": 64, "r": 190, "t": 34, "b": 48},
    )
