"""Fewer lines of a response for drawing: averages in narrow bands of equal ratio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.records.record import ComplexArray, FloatArray

_PER_DECADE = 50
_SMALLEST = 1e-100
"""Standard deviation whose inverse square is still a number."""


def thin(
    measured: FrequencyResponse, model: ComplexArray | None
) -> tuple[FrequencyResponse, ComplexArray | None]:
    """Return measurement and model averaged in the same bands, weighted by 1/sd²."""
    weight = 1.0 / np.maximum(measured.sd, max(1e-9 * np.abs(measured.response).max(), _SMALLEST)) ** 2
    bands = np.floor(np.log10(measured.frequency) * _PER_DECADE)
    starts = np.flatnonzero(np.diff(bands, prepend=-np.inf))
    total = np.add.reduceat(weight, starts)

    def mean(values: FloatArray) -> FloatArray:
        averaged: FloatArray = np.add.reduceat(values * weight, starts) / total
        return averaged

    def complex_mean(values: ComplexArray) -> ComplexArray:
        averaged: ComplexArray = mean(values.real) + 1j * mean(values.imag)
        return averaged

    shown = replace(
        measured,
        frequency=mean(measured.frequency),
        response=complex_mean(measured.response),
        coherence=mean(measured.coherence),
        sd=1.0 / np.sqrt(total),
        noise=None,
        distortion=None,
    )
    return shown, None if model is None else complex_mean(model)
