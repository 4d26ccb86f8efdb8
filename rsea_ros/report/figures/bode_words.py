"""A measured response and its model in a sentence, and how to read their figure."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.records.record import ComplexArray, FloatArray
from rsea_ros.report import words

_CIRCLE = float(np.sqrt(-np.log(0.05)))
"""Radius of the circle that holds 95 % of a circular complex normal variable, in its sd."""
_AGREES = 0.9
_STRAYS = 2.5
"""Radii. Chance alone takes no line farther from a right model."""
_COHERENT = 0.9


def finding(measured: FrequencyResponse, model: ComplexArray | None) -> str:
    """Return the sentence: where model and measurement agree, or where they part the most."""
    ratio = f"{words.channel(measured.output)} per {words.channel(measured.input)}"
    if model is None:
        return words.sentence(f"{ratio}, measured from {_range(measured.frequency)}")
    distance = np.abs(measured.response - model) / (_CIRCLE * np.maximum(measured.sd, 1e-300))
    share = float(np.mean(distance < 1.0))
    trusted = np.where(measured.coherence > 0.5, distance, 0.0)
    worst = int(np.argmax(trusted))
    if share >= _AGREES and trusted[worst] < _STRAYS:
        return words.sentence(
            f"{ratio}: the model lies in the measured 95 % circle at {100.0 * share:.0f} % "
            f"of the frequencies from {_range(measured.frequency)}"
        )
    decibel = 20.0 * np.log10(np.abs(model[worst] / measured.response[worst]))
    where = words.minus(f"{words.number(measured.frequency[worst])} Hz ({decibel:+.1f} dB)")
    return words.sentence(f"{ratio}: the model leaves the measured 95 % circle, most at {where}")


def _range(frequency: FloatArray) -> str:
    return f"{words.number(frequency[0], 2)} to {words.number(frequency[-1], 3)} Hz"


def caption(measured: FrequencyResponse) -> str:
    """Return how far to trust the measurement and how it was made."""
    high = measured.frequency[measured.coherence > _COHERENT]
    reach = f"Coherence is above {_COHERENT:g} up to {words.number(high[-1])} Hz. " if len(high) else ""
    method = f"{words.sentence(measured.method)}, {len(measured.frequency)} frequencies"
    return (
        f"{reach}{method}; hold of the command and acquisition "
        "instants are taken out. Averaged in bands of 5 % for drawing."
    )
