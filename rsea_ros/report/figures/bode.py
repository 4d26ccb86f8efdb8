"""Bode figure: measured response with its 95 % band, the model, and the coherence."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.records.record import UNITS, ComplexArray, FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures.bode_words import caption, finding
from rsea_ros.report.figures.figure import Figure, Json, axis, band, frequency_axis, label, layout, line
from rsea_ros.report.figures.palette import AFTER, MEASURED, QUIET, faint
from rsea_ros.report.figures.thinned import thin

_SIDE = Z95 / np.sqrt(2.0)
"""Half-width of the 95 % interval of a circular complex variable along one direction, in its sd."""
_ROWS = {"gain": [0.64, 1.0], "phase": [0.39, 0.6], "ratio": [0.165, 0.35], "coherence": [0.0, 0.125]}
_MOST_DECIBEL = 12.0


def bode_figure(measured: FrequencyResponse, model: ComplexArray | None = None) -> Figure:
    """Return gain, phase and coherence over frequency. model: at the measured frequencies."""
    shown, shown_model = thin(measured, model)
    data = [*_gain(shown, shown_model), *_phase(shown, shown_model), *_ratio(shown, shown_model)]
    data.append(
        line(shown.frequency, shown.coherence, "coherence", QUIET, 1.2, yaxis="y4", hovertemplate="%{y:.3f}")
    )
    return Figure(
        title=finding(measured, model),
        caption=caption(measured),
        data=data,
        layout=_layout(shown, shown_model),
        height=720,
    )


def _gain(shown: FrequencyResponse, model: ComplexArray | None) -> list[Json]:
    side = _SIDE * shown.sd / np.abs(shown.response)
    decibel = 20.0 * np.log10(np.abs(shown.response))
    low, high = (decibel + _decibel(1.0 + s) for s in (-side, side))
    gain = None if model is None else 20.0 * np.log10(np.abs(model))
    return _measured_and_model(shown.frequency, (low, decibel, high), gain, "y", "%{y:.2f} dB")


def _phase(shown: FrequencyResponse, model: ComplexArray | None) -> list[Json]:
    reference = shown.response if model is None else model
    smooth = np.unwrap(np.angle(reference))
    measured = np.degrees(smooth + np.angle(shown.response / reference))
    side = np.degrees(np.arcsin(np.minimum(_SIDE * shown.sd / np.abs(shown.response), 1.0)))
    phase = None if model is None else np.degrees(smooth)
    return _measured_and_model(
        shown.frequency, (measured - side, measured, measured + side), phase, "y2", "%{y:.1f}°"
    )


def _measured_and_model(
    hz: FloatArray,
    measured: tuple[FloatArray, FloatArray, FloatArray],
    model: FloatArray | None,
    yaxis: str,
    hover: str,
) -> list[Json]:
    """Return the measured values with their band, and the model's on top. measured: low, middle, high."""
    low, middle, high = measured
    place = {"yaxis": yaxis, "hovertemplate": hover}
    traces = [
        band(hz, low, high, faint(MEASURED, 0.28), yaxis=yaxis),
        line(hz, middle, "measured", faint(MEASURED, 0.55), 5.0, **place),
    ]
    return traces if model is None else [*traces, line(hz, model, "model", AFTER, 1.6, **place)]


def _ratio(shown: FrequencyResponse, model: ComplexArray | None) -> list[Json]:
    """Return the gain of the measurement over the model's, where small departures show."""
    if model is None:
        return []
    side = _SIDE * shown.sd / np.abs(shown.response)
    ratio = _decibel(np.abs(shown.response / model))
    low, high = (ratio + _decibel(1.0 + s) for s in (-side, side))
    nothing = np.zeros(2)
    return [
        line(shown.frequency[[0, -1]], nothing, "model", AFTER, 1.6, yaxis="y3", hoverinfo="skip"),
        band(shown.frequency, low, high, faint(MEASURED, 0.28), yaxis="y3"),
        line(
            shown.frequency, ratio, "measured / model", MEASURED, 1.6, yaxis="y3", hovertemplate="%{y:.3f} dB"
        ),
    ]


def _ratio_range(shown: FrequencyResponse, model: ComplexArray | None) -> list[float]:
    """Return a range in dB that shows the deviations of trusted lines and the tolerance."""
    if model is None:
        return [-1.0, 1.0]
    trusted = shown.coherence > 0.5
    reach = np.abs(_decibel(np.abs(shown.response / model))) + _decibel(
        1.0 + _SIDE * shown.sd / np.abs(shown.response)
    )
    most = float(np.quantile(reach[trusted], 0.98)) if trusted.any() else 1.0
    limit = min(_MOST_DECIBEL, max(0.1, 1.2 * most))
    return [-limit, limit]


def _decibel(ratio: FloatArray) -> FloatArray:
    decibel: FloatArray = 20.0 * np.log10(np.maximum(ratio, 0.05))
    return decibel


def _layout(shown: FrequencyResponse, model: ComplexArray | None) -> Json:
    end = 20.0 * float(np.log10(np.abs(shown.response[-1])))
    labels = [label("measured<br>95 % band", 1.01, end, MEASURED, xref="paper", yref="y", yanchor="bottom")]
    if model is not None:
        labels.append(
            label("<b>model</b>", 1.01, end, AFTER, xref="paper", yref="y", yanchor="top", yshift=-4)
        )
    labels.append(label("measured<br>÷ model", 1.01, 0.0, MEASURED, xref="paper", yref="y3"))
    return layout(
        xaxis=frequency_axis(shown.frequency[0], shown.frequency[-1], anchor="y4"),
        yaxis=axis(f"gain, dB{_reference(shown)}", domain=_ROWS["gain"]),
        yaxis2=axis("phase, °", domain=_ROWS["phase"], dtick=90),
        yaxis3=axis("gain, dB", domain=_ROWS["ratio"], range=_ratio_range(shown, model), nticks=5),
        yaxis4=axis("coherence", domain=_ROWS["coherence"], range=[0, 1.08], tickvals=[0, 0.5, 1]),
        annotations=labels,
        hoversubplots="axis",
    )


def _reference(response: FrequencyResponse) -> str:
    """Return the value of 0 dB, for a response with a unit."""
    over = _unit(response)
    return f" re 1 {over}" if over else ""


def _unit(response: FrequencyResponse) -> str:
    above, below = (words.unit(UNITS[n]) for n in (response.output, response.input))
    return "" if above == below else f"{above} per {below}"
