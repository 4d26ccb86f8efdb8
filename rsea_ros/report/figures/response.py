"""Frequency responses with bands and marks; a measured one beside its model, with ratio and coherence."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.records.record import UNITS, ComplexArray, FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig

_SIDE = Z95 / np.sqrt(2.0)
"""Half-width of the 95 % interval of a circular complex variable along one direction, in its sd."""
_CIRCLE = float(np.sqrt(-np.log(0.05)))
"""Radius of the circle that holds 95 % of a circular complex normal variable, in its sd."""
_AGREES, _STRAYS = 0.9, 2.5
"""Share of lines within the circle; radii that chance alone takes no line farther from a right model."""
_COHERENT = 0.9
_MOST_DECIBEL = 12.0
_PER_DECADE = 50
_SMALLEST = 1e-100
"""Standard deviation whose inverse square is still a number."""


@dataclass(frozen=True)
class Band:
    """Limits about a curve at hz, shape (n,): least and largest gain, dB, and phase, deg."""

    hz: FloatArray
    gain: tuple[FloatArray, FloatArray]
    phase: tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class ResponseCurve:
    """A curve: name in the legend at its end, hz and values of shape (n,).

    phase: deg, shape (n,); by default that of the values, continuous from the first. opacity: of the line.
    """

    name: str
    colour: str
    hz: FloatArray
    values: ComplexArray
    width: float = 1.8
    dash: str = ""
    band: Band | None = None
    phase: FloatArray | None = None
    opacity: float = 1.0

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
    return fig.Figure(title, caption, list(_traces(responses)), _layout(responses, marks, decibel), 560)


def _traces(responses: Sequence[ResponseCurve]) -> Iterator[fig.Json]:
    """Yield the traces of gain, dB, and phase, deg, over frequency."""
    for r in responses:
        if r.band is not None:
            shade = fig.faint(r.colour, 0.18)
            yield fig.band(r.band.hz, *r.band.gain, shade)
            yield fig.band(r.band.hz, *r.band.phase, shade, yaxis="y2")
        look: fig.Json = {"width": r.width, "dash": r.dash}
        look |= {"opacity": r.opacity} if r.opacity < 1.0 else {}
        gain = 20.0 * np.log10(np.abs(r.values))
        yield fig.line(r.hz, gain, r.name, r.colour, hovertemplate="%{y:.2f} dB", **look)
        yield fig.line(r.hz, r.degrees, r.name, r.colour, hovertemplate="%{y:.1f}°", yaxis="y2", **look)


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


def bode_figure(measured: FrequencyResponse, model: ComplexArray | None = None) -> fig.Figure:
    """Return gain, phase, ratio and coherence over frequency. model: at the measured frequencies."""
    shown, fit = thin(measured, model)
    hz, response = shown.frequency, shown.response
    side = _SIDE * shown.sd / np.abs(response)
    low, high = _decibel(1.0 - side), _decibel(1.0 + side)
    gain = 20.0 * np.log10(np.abs(response))
    reference = response if fit is None else fit
    phase = np.degrees(np.unwrap(np.angle(reference)) + np.angle(response / reference))
    turn = np.degrees(np.arcsin(np.minimum(side, 1.0)))
    band = Band(hz, (gain + low, gain + high), (phase - turn, phase + turn))
    curves = [ResponseCurve("measured", fig.MEASURED, hz, response, 5.0, "", band, phase, 0.55)]
    curves += [] if fit is None else [ResponseCurve("model", fig.AFTER, hz, fit, 1.6)]
    data = list(_traces(curves))
    limit = 1.0
    if fit is not None:  # the ratio shows small departures: of trusted lines, and the tolerance
        ratio, trusted = _decibel(np.abs(response / fit)), shown.coherence > 0.5
        reach = (np.abs(ratio) + high)[trusted]
        limit = min(_MOST_DECIBEL, max(0.1, 1.2 * float(np.quantile(reach, 0.98)) if trusted.any() else 1.2))
        data += [
            fig.line(hz[[0, -1]], np.zeros(2), "model", fig.AFTER, 1.6, yaxis="y3", hoverinfo="skip"),
            fig.band(hz, ratio + low, ratio + high, fig.faint(fig.MEASURED, 0.28), yaxis="y3"),
            fig.line(
                hz, ratio, "measured / model", fig.MEASURED, 1.6, yaxis="y3", hovertemplate="%{y:.3f} dB"
            ),
        ]
    data.append(
        fig.line(hz, shown.coherence, "coherence", fig.QUIET, 1.2, yaxis="y4", hovertemplate="%{y:.3f}")
    )
    return fig.Figure(
        finding(measured, model), _caption(measured), data, _four_panels(shown, fit is not None, limit), 720
    )


def _decibel(ratio: FloatArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.maximum(ratio, 0.05)))


def _four_panels(shown: FrequencyResponse, has_model: bool, limit: float) -> fig.Json:
    names = [*([("<b>model</b>", fig.AFTER)] if has_model else []), ("measured,<br>95 % band", fig.MEASURED)]
    above, below = (words.unit(UNITS[n]) for n in (shown.output, shown.input))
    reference = "" if above == below else f" re 1 {above} per {below}"
    return fig.layout(
        xaxis=fig.frequency_axis(shown.frequency[0], shown.frequency[-1], anchor="y4"),
        yaxis=fig.axis(f"gain, dB{reference}", domain=[0.64, 1.0]),
        yaxis2=fig.axis("phase, °", domain=[0.39, 0.6], dtick=90),
        yaxis3=fig.axis("gain, dB", domain=[0.165, 0.35], range=[-limit, limit], nticks=5),
        yaxis4=fig.axis("coherence", domain=[0.0, 0.125], range=[0, 1.08], tickvals=[0, 0.5, 1]),
        annotations=[
            *fig.names_beside(names, 0.04),
            fig.label("measured<br>÷ model", 1.015, 0.0, fig.MEASURED, xref="paper", yref="y3"),
        ],
        hoversubplots="axis",
    )


def finding(measured: FrequencyResponse, model: ComplexArray | None) -> str:
    """Return the sentence: where model and measurement agree, or where they part the most."""
    ratio, f = f"{words.channel(measured.output)} per {words.channel(measured.input)}", measured.frequency
    span = f"{words.number(f[0], 2)} to {words.number(f[-1], 3)} Hz"
    if model is None:
        return words.sentence(f"{ratio}, measured from {span}")
    distance = np.abs(measured.response - model) / (_CIRCLE * np.maximum(measured.sd, 1e-300))
    share = float(np.mean(distance < 1.0))
    trusted = np.where(measured.coherence > 0.5, distance, 0.0)
    worst = int(np.argmax(trusted))
    circle = f"{ratio}: the model {{}} the measured 95 % circle"
    if share >= _AGREES and trusted[worst] < _STRAYS:
        at = f"at {100.0 * share:.0f} % of the frequencies from {span}"
        return words.sentence(f"{circle.format('lies in')} {at}")
    decibel = 20.0 * np.log10(np.abs(model[worst] / measured.response[worst]))
    where = words.minus(f"{words.number(f[worst])} Hz ({decibel:+.1f} dB)")
    return words.sentence(f"{circle.format('leaves')}, most at {where}")


def _caption(measured: FrequencyResponse) -> str:
    high = measured.frequency[measured.coherence > _COHERENT]
    reach = f"Coherence is above {_COHERENT:g} up to {words.number(high[-1])} Hz. " if len(high) else ""
    return (
        f"{reach}{words.sentence(measured.method)}, {len(measured.frequency)} frequencies; hold of the "
        "command and acquisition instants are taken out. Averaged in bands of 5 % for drawing."
    )


def thin(
    measured: FrequencyResponse, model: ComplexArray | None
) -> tuple[FrequencyResponse, ComplexArray | None]:
    """Return measurement and model averaged in the same narrow bands of equal ratio, weighted by 1/sd²."""
    weight = 1.0 / np.maximum(measured.sd, max(1e-9 * np.abs(measured.response).max(), _SMALLEST)) ** 2
    bands = np.floor(np.log10(measured.frequency) * _PER_DECADE)
    starts = np.flatnonzero(np.diff(bands, prepend=-np.inf))
    total = np.add.reduceat(weight, starts)

    def mean(values: Any) -> Any:
        return np.add.reduceat(values * weight, starts) / total

    shown = replace(
        measured, frequency=mean(measured.frequency), response=mean(measured.response),
        coherence=mean(measured.coherence), sd=1.0 / np.sqrt(total), noise=None, distortion=None,
    )  # fmt: skip
    return shown, None if model is None else mean(model)
