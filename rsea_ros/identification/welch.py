"""Averaged spectra of overlapping segments, for records of random excitation.

    G = sum Y_k U_k* / sum |U_k|^2,   var G = s2 (sum |U_k|^2 + 2 rho Re sum U_k U_{k+1}*) / (sum |U_k|^2)^2

s2 is the residual power of a segment and rho = 1/6 the correlation of noise between Hann segments that
overlap by half. (Welch, IEEE Trans. Audio Electroacoust. 15, 1967; Bendat, Piersol, Random Data, 4th ed., 9.)
"""

from __future__ import annotations

import numpy as np
from numpy.fft import rfft

from rsea_ros.identification.resample import Aligned
from rsea_ros.identification.response_lines import Lines, detrend, widen
from rsea_ros.records.record import ComplexArray, FloatArray, IntArray
from rsea_ros.records.spectra import next_fast_length

LONGEST_SEGMENT = 16.0
"""s. Long against what the actuator remembers, so that segments leak little."""
FEWEST_SEGMENTS = 12
_SHORTEST_SEGMENT = 4.0
_FIRST_LINE = 2
_ALIKE = 0.25
"""Random segments come to 0.5 in the middle and 0.3 at the 5 % quantile that is asked."""
_OVERLAP_CORRELATION = 1.0 / 6.0
_TINY = 1e-300


def suits(aligned: Aligned) -> bool:
    """Return whether a record is long enough for this method, and its command alike in all segments.

    A sweep has its low frequencies in few segments: (sum |U|^2)^2 / sum |U|^4 counts them.
    """
    length = _length(aligned)
    starts = _starts(aligned, length)
    if length * aligned.period < _SHORTEST_SEGMENT or len(starts) < FEWEST_SEGMENTS:
        return False
    power = np.abs(_segments(aligned.command, starts, length)[:, _FIRST_LINE:]) ** 2
    bearing = np.sum(power, axis=0) ** 2 / (np.sum(power**2, axis=0) + _TINY)
    return float(np.quantile(bearing, 0.05)) > _ALIKE * len(starts)


def welch(aligned: Aligned) -> Lines:
    """Return the response by averaging over the segments that have no gap."""
    length = _length(aligned)
    starts = _starts(aligned, length)
    u, y = (_segments(x, starts, length) for x in (aligned.command, aligned.output))
    s_uu = np.sum(np.abs(u) ** 2, axis=0) + _TINY
    response = np.sum(y * u.conj(), axis=0) / s_uu
    effective = len(starts) / (1.0 + 2.0 * _OVERLAP_CORRELATION**2)
    residual = np.sum(np.abs(y - response * u) ** 2, axis=0) / len(starts) * effective / (effective - 1.0)
    next_to = (starts[1:] - starts[:-1] == length // 2)[:, None]
    overlap = np.sum(next_to * _align_phases(u[1:] * u[:-1].conj(), length).real, axis=0)
    spread = np.sqrt(residual * np.maximum(s_uu + 2.0 * _OVERLAP_CORRELATION * overlap, 0.5 * s_uu)) / s_uu
    s_yy = np.sum(np.abs(y) ** 2, axis=0) + _TINY
    keep = slice(_FIRST_LINE, None)
    return Lines(
        method="Welch",
        frequency=(np.arange(u.shape[1]) / (length * aligned.period))[keep],
        response=response[keep],
        sd=widen(spread, effective - 1.0)[keep],
        coherence=np.minimum(np.abs(response) ** 2 * s_uu / s_yy, 1.0)[keep],
        noise=(np.sqrt(2.0 * residual / np.sum(_window(length) ** 2) / length))[keep],
    )


def _length(aligned: Aligned) -> int:
    """Return the segment length in samples, even."""
    duration = len(aligned.command) * aligned.period
    seconds = min(LONGEST_SEGMENT, duration / (FEWEST_SEGMENTS / 2.0 + 1.0))
    return 2 * int(next_fast_length(int(seconds / aligned.period / 2.0), real=True))


def _starts(aligned: Aligned, length: int) -> IntArray:
    starts = np.arange(0, len(aligned.command) - length + 1, length // 2)
    missing = np.concatenate([[0], np.cumsum(~aligned.measured)])
    whole: IntArray = starts[missing[starts + length] == missing[starts]]
    return whole


def _segments(values: FloatArray, starts: IntArray, length: int) -> ComplexArray:
    """Return the windowed spectra, shape (segments, lines)."""
    windows = np.lib.stride_tricks.sliding_window_view(detrend(values), length)[starts]
    spectra: ComplexArray = rfft(windows * _window(length), axis=1)
    return spectra


def _window(length: int) -> FloatArray:
    window: FloatArray = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    return window


def _align_phases(cross: ComplexArray, length: int) -> ComplexArray:
    """Refer the product of neighbouring spectra to one time: half a segment is a turn of pi a line."""
    turned: ComplexArray = cross * (-1.0) ** np.arange(cross.shape[1])
    return turned
