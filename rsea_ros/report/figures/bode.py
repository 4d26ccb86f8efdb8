"""Bode figure: measured response with its 95 % band, the model, their ratio, the coherence; its finding."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, TypeVar

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
Values = TypeVar("Values", FloatArray, ComplexArray)
Sides = tuple[FloatArray, FloatArray, FloatArray]


def bode_figure(measured: FrequencyResponse, model: ComplexArray | None = None) -> fig.Figure:
    """Return gain, phase, ratio and coherence over frequency. model: at the measured frequencies."""
    shown, fit = thin(measured, model)
    hz, response = shown.frequency, shown.response
    side = _SIDE * shown.sd / np.abs(response)
    low, high = _decibel(1.0 - side), _decibel(1.0 + side)
    gain = 20.0 * np.log10(np.abs(response))
    reference = response if fit is None else fit
    smooth = np.unwrap(np.angle(reference))
    phase = np.degrees(smooth + np.angle(response / reference))
    turn = np.degrees(np.arcsin(np.minimum(side, 1.0)))
    model_gain, model_phase = 20.0 * np.log10(np.abs(reference)), np.degrees(smooth)
    data = list(_curves(hz, (gain + low, gain, gain + high), fit is not None, model_gain, "y", "%{y:.2f} dB"))
    data += _curves(hz, (phase - turn, phase, phase + turn), fit is not None, model_phase, "y2", "%{y:.1f}°")
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
        finding(measured, model), _caption(measured), data, _layout(shown, fit is not None, limit), 720
    )


def _curves(
    hz: FloatArray, measured: Sides, has_model: bool, model: FloatArray, y: str, hover: str
) -> Iterator[fig.Json]:
    """Return the measured values with their band, and the model's on top. measured: low, middle, high."""
    low, middle, high = measured
    yield fig.band(hz, low, high, fig.faint(fig.MEASURED, 0.28), yaxis=y)
    yield fig.line(hz, middle, "measured", fig.faint(fig.MEASURED, 0.55), 5.0, yaxis=y, hovertemplate=hover)
    if has_model:
        yield fig.line(hz, model, "model", fig.AFTER, 1.6, yaxis=y, hovertemplate=hover)


def _decibel(ratio: FloatArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.maximum(ratio, 0.05)))


def _layout(shown: FrequencyResponse, has_model: bool, limit: float) -> fig.Json:
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

    def mean(values: Values) -> Values:
        averaged: Any = np.add.reduceat(values * weight, starts) / total
        return averaged  # type: ignore[no-any-return]

    shown = replace(
        measured, frequency=mean(measured.frequency), response=mean(measured.response),
        coherence=mean(measured.coherence), sd=1.0 / np.sqrt(total), noise=None, distortion=None,
    )  # fmt: skip
    return shown, None if model is None else mean(model)
