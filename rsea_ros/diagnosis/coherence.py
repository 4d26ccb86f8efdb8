"""Coherence with the command: it shows a missed response that the noise hides in the residual's size.

In segments of a block each, coherence^2 = |S_ru|^2 / (S_rr S_uu) of the residual r and the command u. Of K
segments of mere noise it exceeds 1 - a^(1 / (K - 1)) with probability a (Carter, IEEE Proc. 75, 1987).
"""

from __future__ import annotations

import numpy as np

from rsea_ros.diagnosis.settings import BlockSettings
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray, IntArray
from rsea_ros.records.spectra import cross_density, power_density

_LOST = 0.5
"""Coherence^2 below which more than half of a channel's power has nothing to do with the command."""
_MOST = 0.75
"""Share of the lines above an edge that must be lost, and of those below it that must not."""
_LINES = 1024
_SEGMENTS = 16
"""Of a spectrum at least: of fewer, noise alone is coherent."""
_SHORTEST = 8
"""Samples of a segment: a shorter one has no band to speak of."""
_LOWEST = 2.0
"""Hz: below it a drift may hide the command. But for _SHORTEST, these steer a remark and no verdict."""


def missed_response(
    case: Case, output: FloatArray, channel: str, blocks: IntArray, rule: BlockSettings
) -> float:
    """Return the largest coherence^2 of a residual with the command where the model misses a response, or 0.

    blocks: number of the block of each sample of the channel; those with faulty samples are left out.
    """
    if not isinstance(case.drive, Drive):
        return 0.0
    u = command_at(case.drive, case.t[channel])
    parts = _segments(blocks, case.mask[channel])
    if len(parts) < rule.response_blocks:
        return 0.0
    r, y, u_hat = (_spectra(parts, v) for v in (case.measured[channel] - output, output, u))
    coherence = _coherence(r, u_hat)
    chance = 1.0 - (rule.false_alarm / r.shape[1]) ** (1.0 / (len(parts) - 1))
    limit = max(rule.response_clear, chance)
    error, response = (np.abs(np.sum(v * u_hat.conj(), axis=0)) for v in (r, y))
    missed = error > rule.response_share * response
    return float(np.max(np.where(missed & (coherence > limit), coherence, 0.0)))


def lost_above(case: Case, channel: str) -> float | None:
    """Return the frequency, Hz, above which a channel is mostly noise although the command excites it."""
    if not isinstance(case.drive, Drive):
        return None
    t = case.t[channel]
    u, y = command_at(case.drive, t), case.measured[channel]
    rate, length = 1.0 / float(np.median(np.diff(t))), min(_LINES, len(t) // _SEGMENTS)
    if length < _SHORTEST:
        return None
    frequency, power = power_density(u, rate, length)
    cross = np.abs(cross_density(u, y, rate, length)[1]) ** 2
    coherence = cross / np.maximum(power * power_density(y, rate, length)[1], 1e-300)
    is_excited = (power > 1e-3 * np.median(power)) & (frequency > _LOWEST)
    is_lost, frequency = (coherence < _LOST)[is_excited], frequency[is_excited]
    count = np.arange(1, len(is_lost) + 1)
    above = np.cumsum(is_lost[::-1])[::-1] / count[::-1]
    below = (np.cumsum(is_lost) - is_lost) / count
    edges = np.flatnonzero(is_lost & (above >= _MOST) & (below <= 1.0 - _MOST))
    return float(frequency[edges[0]]) if len(edges) and 0 < edges[0] < _MOST * len(frequency) else None


def command_at(drive: Drive, t: FloatArray) -> FloatArray:
    """Return the command that acts at times, N m."""
    steps = ((t - drive.start) / drive.step).astype(np.int64)
    return np.asarray(drive.command[np.clip(steps, 0, len(drive.command) - 1)])


def _segments(blocks: IntArray, good: BoolArray) -> list[IntArray]:
    """Return the samples of every block without masked ones, cut to the same length."""
    blocks_of_samples = np.split(np.arange(len(blocks)), np.flatnonzero(np.diff(blocks)) + 1)
    whole = [p for p in blocks_of_samples if good[p].all()]
    length = int(np.median([len(p) for p in whole])) - 2 if whole else 0
    return [p[:length] for p in whole if len(p) >= length > _SHORTEST]


def _spectra(parts: list[IntArray], values: FloatArray) -> ComplexArray:
    """Return the spectra of the segments without mean and highest line, shape (segments, frequencies)."""
    cut = np.array([values[p] - values[p].mean() for p in parts])
    return np.asarray(np.fft.rfft(cut * np.hanning(cut.shape[1]), axis=1)[:, 1:-1])


def _coherence(a: ComplexArray, b: ComplexArray) -> FloatArray:
    cross = np.abs(np.sum(a * b.conj(), axis=0)) ** 2
    return np.asarray(cross / np.maximum((np.abs(a) ** 2).sum(axis=0) * (np.abs(b) ** 2).sum(axis=0), 1e-300))
