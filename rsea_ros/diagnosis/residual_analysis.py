"""Where the residual is: by frequency, amplitude, velocity, time, angle, each with its uncertainty."""

import itertools
from typing import NamedTuple

import numpy as np

from rsea_ros.diagnosis.result import Misfit, Spectrum
from rsea_ros.identification.problem import Case, residual_of
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import stamped_density


def edges_of(values: FloatArray, count: int, *, equal: bool) -> FloatArray:
    """Return the edges of bins, rising: of equal width, or with equal numbers of values.

    Where many values are the same the bins are fewer than `count`.
    """
    shares = np.linspace(0.0, 1.0, count + 1)
    edges = np.linspace(values.min(), values.max(), count + 1) if equal else np.quantile(values, shares)
    distinct: FloatArray = np.unique(edges)
    return distinct if len(distinct) > 1 else np.array([distinct[0], distinct[0] + 1e-12])


def rms_in(edges: FloatArray, values: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the RMS of the residual in each bin; NaN where a bin is empty."""
    count = len(edges) - 1
    which = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, count - 1)
    number = np.bincount(which, minlength=count).astype(float)
    return np.sqrt(np.bincount(which, residual**2, count) / np.where(number > 0.0, number, np.nan))


_SHOWN_ABOVE = 1.25
"""Times the noise. It steers what is shown, no verdict."""
_BINS = 8
_SEGMENT = 2048
"""Samples."""
_MOST = 3
"""Misfits shown in each respect."""


def misfits(case: Case, outputs: dict[str, FloatArray], channel: str, rig: Rig) -> tuple[Misfit, ...]:
    """Return where the residual of a channel is more than its noise, worst first in each respect."""
    residual = residual_of(case, outputs, channel)
    worst = _worst(by_frequency(case.t[channel], residual, case.noise[channel], channel))
    keep = case.mask[channel]
    for respect in _respects(case, channel, rig):
        masked = respect._replace(values=respect.values[keep])
        worst += _worst(_level_in_bins(masked, residual[keep], case.noise[channel], channel))
    return tuple(worst)


def by_frequency(t: FloatArray, residual: FloatArray, noise: float, channel: str) -> list[Misfit]:
    """Return the residual's level in third-octave bands over that of white noise of the floor's size."""
    rate, frequency, level = stamped_density(t, residual, _SEGMENT)
    white = noise**2 / (0.5 * rate)
    edges = np.geomspace(max(frequency[1], 0.5), 0.5 * rate, 3 * 8 + 1)
    bands = []
    for low, high in itertools.pairwise(edges):
        inside = (frequency >= low) & (frequency < high)
        if inside.any():
            over_noise = float(np.sqrt(level[inside].mean() / white))
            bands.append(Misfit("frequency_band", float(low), float(high), "Hz", over_noise, channel))
    return bands


def spectrum(
    case: Case, before: dict[str, FloatArray], after: dict[str, FloatArray], channel: str
) -> Spectrum:
    """Return the residual's amplitude density before and after, with the noise floor's."""
    densities = []
    for outputs in (before, after):
        residual = residual_of(case, outputs, channel)
        rate, frequency, level = stamped_density(case.t[channel], residual, _SEGMENT)
        densities.append(np.sqrt(level))
    return Spectrum(
        channel, frequency[1:], densities[0][1:], densities[1][1:], case.noise[channel] / np.sqrt(0.5 * rate)
    )


class _Respect(NamedTuple):
    """A variable over which a residual is shown: a value at each sample. is_even: in bins of equal width."""

    what: str
    unit: str
    values: FloatArray
    is_even: bool = False


def _respects(case: Case, channel: str, rig: Rig) -> list[_Respect]:
    """Return all that the residual of a channel is laid out against."""
    t, respects = case.t[channel], []
    if "ft" in case.measured:
        load = np.abs(np.interp(t, case.t["ft"], case.measured["ft"]))
        respects.append(_Respect("amplitude", "N m", load))
    if "velocity" in case.measured:
        velocity = np.interp(t, case.t["velocity"], case.measured["velocity"])
        respects.append(_Respect("velocity", "rad/s", velocity))
    if isinstance(case.drive, Drive) and "position" in case.measured:
        turns = np.interp(t, case.t["position"], case.measured["position"]) * rig["gear.ratio"]
        respects.append(_Respect("angle", "rad", np.mod(turns, 2.0 * np.pi)))
    return [*respects, _Respect("time", "s", t - case.start, is_even=True)]


def _level_in_bins(respect: _Respect, residual: FloatArray, noise: float, channel: str) -> list[Misfit]:
    """Return the residual's level in bins of equal width, or of equally many samples."""
    values = respect.values
    if len(values) < 4 * _BINS:
        return []
    edges = edges_of(values, _BINS, equal=respect.is_even)
    levels = rms_in(edges, values, residual) / noise
    return [
        Misfit(respect.what, float(low), float(high), respect.unit, float(level), channel)
        for (low, high), level in zip(itertools.pairwise(edges), levels, strict=True)
    ]


def _worst(items: list[Misfit]) -> list[Misfit]:
    """Return the worst misfits that are clearly above the noise."""
    return sorted((m for m in items if m.times_noise > _SHOWN_ABOVE), key=lambda m: -m.times_noise)[:_MOST]
