"""The noise of every channel after a fit, from its residual.

A floor is never above the residual's white part, which no law of the bench can make; and where all of a
residual passes for noise of the sensor (coloured.py) it equals that residual. That noise is called coloured
only where it exceeds its white part by more than the doubt of that part, which is large in short records.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.identification.coloured import is_noise, residual_of
from rsea_ros.identification.noise import top_of_band
from rsea_ros.identification.noise_settings import DEFAULT, NoiseSettings
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import FloatArray, IntArray

_WHITE_DOUBT = 1.5
"""Relative standard deviation of the RMS of white noise read off the top of the band, times sqrt(samples).

The median over a share of 0.36 of the lines has 1.25 / sqrt(0.18 n) of its power, half of that of its RMS.
"""
_BLOCK = 1.0
"""s. Coloured noise is independent from one such block to the next."""


def reestimate_noise(
    case: Case, outputs: Mapping[str, FloatArray], ratio: float = 1.0, rule: NoiseSettings = DEFAULT
) -> Case:
    """Return a case with its noise from a fitted model's residual.

    outputs: simulated, by channel. ratio: of the gear, rotor over output, for ripple. Coloured noise is taken
    only where every channel above its white noise passes for noise: a misfit seldom shows in one alone.
    """
    channels = [n for n in case.measured if n in outputs and case.mask[n].any()]
    residuals = {n: residual_of(case, outputs, n) for n in channels}
    rms = {n: float(np.sqrt(np.mean(residuals[n][case.mask[n]] ** 2))) for n in channels}
    noise = dict(case.noise)
    for n in channels:
        white, is_white = top_of_band(residuals[n], _seams(case, n), rule)
        level = white if is_white and isinstance(case.drive, Drive) else rms[n]  # a Motion is filtered
        noise[n] = max(min(noise[n], level), case.least.get(n, 0.0))
    above = [n for n in channels if rms[n] > rule.above * noise[n]]
    if not above or not all(is_noise(case, outputs, n, ratio, rule) for n in above):
        return replace(case, noise=noise, coloured=frozenset())
    coloured = frozenset(n for n in above if rms[n] > _surely_above(case, n, rule) * noise[n])
    for n in above:
        noise[n] = rms[n] * (1.0 + 2.0 * _doubt(case, residuals[n], n) if n in coloured else 1.0)
    return replace(case, noise=noise, coloured=coloured)


def _seams(case: Case, channel: str) -> IntArray:
    """Return the samples of a channel with which a span of a record begins, but for the first."""
    drive = case.drive
    if not isinstance(drive, Drive):
        return np.empty(0, np.int64)
    ends = [drive.start + drive.step * end for _, end in drive.spans[:-1]]
    return np.searchsorted(case.t[channel], ends)


def _surely_above(case: Case, channel: str, rule: NoiseSettings) -> float:
    """Return the RMS of a residual over its white part that chance does not reach, `rule.above` at least."""
    samples = np.count_nonzero(case.mask[channel])
    return max(rule.above, 1.0 + rule.sure * _WHITE_DOUBT / float(np.sqrt(samples)))


def _doubt(case: Case, residual: FloatArray, channel: str) -> float:
    """Return the relative standard deviation of the RMS of a residual, from how it varies over time."""
    keep = case.mask[channel]
    block = np.floor((case.t[channel][keep] - case.start) / _BLOCK).astype(np.int64)
    block -= block.min()
    counts = np.bincount(block)
    power = (np.bincount(block, residual[keep] ** 2) / np.maximum(counts, 1))[counts > 0]
    if len(power) < 2 or power.mean() == 0.0:
        return 0.0
    return float(0.5 * power.std() / power.mean() / np.sqrt(len(power)))
