"""Response of one signal to another, by frequency, over half-overlapping Hann segments k.

    R = sum_k Y_k X_k* / sum_k |X_k|^2

Where x is what a model predicts of y at the same stamps, hold, sampling and leakage are alike in both, and R
is 1 at every line where the model is right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray, IntArray
from rsea_ros.records.statistics import next_fast_length, segment_spectra

_SEGMENTS = 5
"""A record is cut into segments of a fifth: slow ramps still have their line, and nine of them overlap."""
_LONGEST = 8.0
"""s. Of a segment, where the record has more than five such."""
_FEWEST = 16
"""Samples of a segment, at rates that put fewer into its longest."""
_LINES = 48
_ENOUGH = 0.3
"""Of the predicted power: lines that hold less say nothing of a channel."""
_FIRST = 2
_TINY = 1e-300
FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class Quotient:
    """Measured over predicted in bands of about equal width on a logarithmic scale.

    frequency: Hz, shape (n,). value: complex, shape (n,). coherence: 0 to 1, shape (n,).
    sd: standard deviation of ln(value), shape (n,). weight: share of the predicted power, shape (n,).
    segments: how many independent ones. lines: how many lines bear the predicted power. related: coherence
    of all lines, each by its share of the predicted power.
    measured, predicted: RMS without mean, in the channel's unit. captured: share of the predicted power that
    these lines hold.
    """

    channel: str
    frequency: FloatArray
    value: ComplexArray
    coherence: FloatArray
    sd: FloatArray
    weight: FloatArray
    segments: float
    lines: float
    related: float
    measured: float
    predicted: float
    captured: float

    @property
    def is_unrelated(self) -> bool:
        """Whether the channel has no more in common with the prediction than noise has by chance."""
        single = 1.0 - FALSE_ALARM ** (1.0 / max(self.segments - 1.0, 1.0))
        chance = 1.0 / self.segments
        limit = chance + (single - chance) / math.sqrt(max(self.lines, 1.0))
        return bool(self.related < limit and self.captured > _ENOUGH)


def quotient(channel: str, t: FloatArray, y: FloatArray, p: FloatArray) -> Quotient | None:
    """Return the quotient of measured y and predicted p at stamps t (s), None for too few samples."""
    if len(t) < 64 or not np.isfinite(p).all():
        return None
    period = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1], period)
    y, p = (np.interp(even, t, v) for v in (y, p))
    if len(even) < _FEWEST * _SEGMENTS or not (np.std(p) > 0.0 and np.std(y) > 0.0):
        return None
    longest = next_fast_length(max(_FEWEST, int(_LONGEST / period)))
    length = min(len(even) // _SEGMENTS, longest)
    pp = _segments(p, length)
    if _captured_share(pp, p) < _ENOUGH:  # slow: its lines lie below those of short segments
        length = len(even) // _SEGMENTS
        pp = _segments(p, length)
    yy = _segments(y, length)
    cross = np.sum(yy * pp.conj(), axis=0)
    power_y, power_p = (np.sum(np.abs(v) ** 2, axis=0) + _TINY for v in (yy, pp))
    segments = len(yy) / (1.0 + 2.0 / 36.0) if len(yy) > 1 else 1.0
    share = power_p / power_p.sum()
    bands = _bands(len(cross))
    s_yp: ComplexArray = np.add.reduceat(cross, bands)
    s_pp, s_yy = (np.add.reduceat(v, bands) for v in (power_p, power_y))
    width = np.diff(np.append(bands, len(cross)))
    coherence = np.abs(s_yp) ** 2 / (s_pp * s_yy)
    averages = np.maximum(segments * width, 2.0)
    return Quotient(
        channel=channel,
        frequency=np.add.reduceat(np.arange(len(cross)) + _FIRST, bands) / width / (length * period),
        value=s_yp / s_pp, coherence=coherence,
        sd=np.sqrt(np.maximum(1.0 - coherence, 1e-6) / (2.0 * np.maximum(coherence, 1e-9) * averages)),
        weight=np.add.reduceat(share, bands), segments=segments, lines=1.0 / float(np.sum(share**2)),
        related=float(np.sum(share * np.abs(cross) ** 2 / (power_y * power_p))), measured=float(np.std(y)),
        predicted=float(np.std(p)), captured=_captured_share(pp, p),
    )


def _captured_share(spectra: ComplexArray, values: FloatArray) -> float:
    """Return the share of a signal's power that its segments' lines hold."""
    length = 2.0 * spectra.shape[1]
    power = 2.0 * float(np.mean(np.sum(np.abs(spectra) ** 2, axis=1))) / (0.375 * length**2)
    return float(power / np.var(values))


def usable(q: Quotient) -> BoolArray:
    """Return the informative bands: coherent, and with more than a trace of the predicted power."""
    keep: BoolArray = (q.coherence > 0.3) & (q.weight > 1e-7 * q.weight.max()) & np.isfinite(q.sd)
    return keep


def _segments(values: FloatArray, length: int) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments from the second line on, shape (k, lines)."""
    spectra = segment_spectra(values, length)
    return spectra[:, _FIRST : int(0.9 * spectra.shape[1])]


@lru_cache(maxsize=64)
def _bands(lines: int) -> IntArray:
    """Return where each band begins, shape (bands,)."""
    edges = np.geomspace(1.0, lines + 1.0, _LINES + 1)[:-1]
    return np.unique(np.floor(edges).astype(np.int64) - 1)
