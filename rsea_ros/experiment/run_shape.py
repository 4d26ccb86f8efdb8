"""The shape of a run: a few numbers that determine the command (N m) of a given length.

Every run begins and ends at zero torque under a raised cosine. Multisines have phases of low crest:
Schroeder's, then made flatter by clipping (Schroeder, IEEE Trans. Inf. Theory 16, 1970; van der Ouderaa,
Schoukens, Renneboog, IEEE Trans. Instrum. Meas. 37, 1988).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

import numpy as np

from rsea_ros.identification.excitation import NYQUIST_SHARE, ExcitationSettings, chirp, ramp_ends
from rsea_ros.records.record import FloatArray

Kind = Literal["multisine", "chirp", "steps", "holds"]
RAMP = 0.25
"""s, of the soft start and stop; of a short run a quarter of it."""
LEAD, TAIL = 0.35, 0.25
"""s at rest before and after: the bench settles, and what it still does is recorded."""
_CLIPPINGS, _CLIP = 15, 0.85
_STEPS = np.array([1.0, -0.4, 0.7, -1.0, 0.3, -0.7, 0.4, 0.0])
_HOLDS = np.array([0.35, 0.7, 1.0, 0.7, 0.35, 0.0, -0.35, -0.7, -1.0, -0.7, -0.35, 0.0])


@dataclass(frozen=True)
class Shape:
    """The form of a run; see KINDS.

    amplitude: N m, peak of the moving part. bias: N m, held beside it. low, high: band, Hz, of multisine and
    chirp. tilt: an amplitude goes with frequency to the power of -tilt, 1. hold: s, of one level of steps (up
    and down at random) and holds (a staircase up and down). rest: share of the run, at its end, at zero.
    """

    kind: Kind
    amplitude: float
    bias: float = 0.0
    low: float = 0.1
    high: float = 60.0
    tilt: float = 0.0
    hold: float = 0.5
    rest: float = 0.0


def command_of(shape: Shape, duration: float, rate: float, slew: float = np.inf) -> FloatArray:
    """Return the command of a shape, N m, shape (n,), at rest for LEAD before it and TAIL after it.

    duration: s, of the excitation, its ramps and rest included. slew: N m/s. Where its change from sample to
    sample would be faster, a multisine or chirp gets smaller and a step becomes a ramp.
    """
    n = round(duration * rate)
    moving = n - round(shape.rest * n)
    part = KINDS[shape.kind](shape, moving, rate)
    run = ramp_ends(shape.bias + shape.amplitude * part, min(round(RAMP * rate), moving // 4))
    if np.isfinite(slew):
        run = slow(run, slew / rate, is_stepped=shape.kind in ("steps", "holds"))
    return at_rest_around(np.concatenate([run, np.zeros(n - moving)]), rate)


def at_rest_around(run: FloatArray, rate: float) -> FloatArray:
    """Return a run with its rest before and after."""
    whole: FloatArray = np.pad(run, (round(LEAD * rate), round(TAIL * rate)))
    return whole


def slow(command: FloatArray, most: float, *, is_stepped: bool) -> FloatArray:
    """Return a command that changes by at most `most` from sample to sample, N m: smoothed, or smaller."""
    change = float(np.max(np.abs(np.diff(command, prepend=0.0, append=0.0))))
    if change <= most:
        return command
    if not is_stepped:
        return command * (most / change)
    width = int(np.ceil(change / most))
    smooth: FloatArray = np.convolve(command, np.full(width, 1.0 / width))[: len(command)]
    return ramp_ends(smooth, width)


def _multisine(shape: Shape, n: int, rate: float) -> FloatArray:
    return _flat_multisine(n, rate, shape.low, _top(shape, rate), shape.tilt)


@lru_cache(64)
def _flat_multisine(n: int, rate: float, low: float, top: float, tilt: float) -> FloatArray:
    """Return a multisine of low crest with lines n / rate apart, its peak 1, shape (n,)."""
    first = max(1, round(low * n / rate))
    lines = np.arange(first, max(first, int(top * n / rate)) + 1)
    size = (lines / lines[0]) ** -tilt
    power = size**2 / np.sum(size**2)
    spectrum = np.zeros(n // 2 + 1, complex)
    phase = -2.0 * np.pi * np.cumsum(np.concatenate([[0.0], np.cumsum(power)[:-1]]))
    spectrum[lines] = size * np.exp(1j * phase)
    for _ in range(_CLIPPINGS):
        signal = np.fft.irfft(spectrum, n)
        clipped = np.fft.rfft(np.clip(signal, *(np.array([-1.0, 1.0]) * _CLIP * np.max(np.abs(signal)))))
        spectrum[lines] = size * np.exp(1j * np.angle(clipped[lines]))
    signal = np.fft.irfft(spectrum, n)
    result: FloatArray = signal / np.max(np.abs(signal))
    return result


def _chirp(shape: Shape, n: int, rate: float) -> FloatArray:
    settings = ExcitationSettings(
        rate=rate, duration=n / rate, amplitude=1.0, noise=0.0, low=shape.low, high=_top(shape, rate)
    )
    return chirp(settings)[:n]


def _steps(shape: Shape, n: int, rate: float) -> FloatArray:
    return _levels(_STEPS, shape, n, rate)


def _holds(shape: Shape, n: int, rate: float) -> FloatArray:
    return _levels(_HOLDS, shape, n, rate)


def _levels(levels: FloatArray, shape: Shape, n: int, rate: float) -> FloatArray:
    which = (np.arange(n) / rate / shape.hold).astype(np.int64)
    result: FloatArray = levels[which % len(levels)]
    return result


def _top(shape: Shape, rate: float) -> float:
    return min(shape.high, NYQUIST_SHARE * rate / 2.0)


KINDS: Mapping[Kind, Callable[[Shape, int, float], FloatArray]] = MappingProxyType(
    {"multisine": _multisine, "chirp": _chirp, "steps": _steps, "holds": _holds}
)
"""Each makes the moving part, its peak 1, from shape, number of samples and rate."""
FEWEST: Mapping[Kind, int] = MappingProxyType({"multisine": 4, "chirp": 10, "steps": 4, "holds": 4})
"""Samples of a run, with which it still has its form, a soft start and a soft stop."""
