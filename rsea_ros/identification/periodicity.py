"""Whether a command repeats, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.records.record import FloatArray
from rsea_ros.records.spectra import next_fast_length

FEWEST_PERIODS = 3
"""One settles, two separate noise from signal."""
_SAME = 0.02
_MOVES = 0.5
"""Of a command's standard deviation: a period moves more; a slow command is alike from sample to sample."""
_LIKELY = 0.5
_TRIED = 12


@dataclass(frozen=True)
class Periods:
    """A stretch of whole periods: first sample, samples a period, how many."""

    first: int
    length: int
    count: int


def find_periods(command: FloatArray) -> Periods | None:
    """Return the longest stretch over which a command repeats at least FEWEST_PERIODS times, or None."""
    candidates = (_stretch(command, lag) for lag in _likely_lags(command))
    return next((p for p in candidates if p is not None and p.count >= FEWEST_PERIODS), None)


def _likely_lags(command: FloatArray) -> list[int]:
    """Return the shortest lags at which the autocorrelation peaks, samples."""
    n = len(command)
    centred = command - command.mean()
    size = next_fast_length(2 * n, real=True)
    correlation = irfft(np.abs(rfft(centred, size)) ** 2, size)[: n // FEWEST_PERIODS + 1]
    if len(correlation) < 3 or correlation[0] <= 0.0:
        return []
    unbiased = correlation / correlation[0] * n / (n - np.arange(len(correlation)))
    inner, after = unbiased[1:], np.append(unbiased[2:], 0.0)
    peaks = 1 + np.flatnonzero((inner > unbiased[:-1]) & (inner >= after) & (inner >= _LIKELY))
    high = peaks[unbiased[peaks] > 0.9 * unbiased[peaks].max()] if len(peaks) else peaks
    return [int(lag) for lag in high[:_TRIED]]


def _stretch(command: FloatArray, lag: int) -> Periods | None:
    """Return the longest stretch that repeats with this lag."""
    same = np.abs(command[lag:] - command[:-lag]) <= _SAME * np.std(command)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    starts, stops = edges[::2], edges[1::2]
    if len(starts) == 0:
        return None
    longest = int(np.argmax(stops - starts))
    count = int((stops[longest] - starts[longest]) // lag + 1)
    periods = Periods(int(stops[longest] + lag - count * lag), lag, count)
    period = command[periods.first : periods.first + lag]
    return periods if np.ptp(period) > _MOVES * np.std(command) else None
