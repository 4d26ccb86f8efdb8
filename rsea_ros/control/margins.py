"""How far a loop is from the edge of stability: gain, phase, delay, and the distance to -1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import ComplexArray, FloatArray


@dataclass(frozen=True)
class Margins:
    """crossover: the highest one, Hz. phase: deg. gain: dB, up or down. delay: samples.

    Each is the smallest over all crossings, inf where there is none. sensitivity: largest |1 / (1 + L)|.
    """

    crossover: float
    phase: float
    gain: float
    delay: float
    sensitivity: float


def margins(loop: ComplexArray, hz: FloatArray, period: float) -> Margins:
    """Return the margins of a loop from its response, by straight lines between its points."""
    crossings, at = _crossings(np.abs(loop) - 1.0, loop, hz)
    behind = np.angle(-crossings) % (2.0 * np.pi)  # rotated back by this angle it meets -1
    phases = np.degrees(np.abs(np.angle(-crossings)))
    turned, _ = _crossings(loop.imag, loop, hz)
    gains = np.abs(20.0 * np.log10(np.abs(turned[turned.real < 0.0])))
    return Margins(
        crossover=float(at.max(initial=0.0)),
        phase=float(phases.min(initial=np.inf)),
        gain=float(gains.min(initial=np.inf)),
        delay=float((behind / (2.0 * np.pi * at * period)).min(initial=np.inf)),
        sensitivity=float(np.max(1.0 / np.abs(1.0 + loop))),
    )


def least(several: list[Margins]) -> Margins:
    """Return the worst of each margin; crossover: the highest."""
    return Margins(
        max(m.crossover for m in several),
        min(m.phase for m in several),
        min(m.gain for m in several),
        min(m.delay for m in several),
        max(m.sensitivity for m in several),
    )


def encirclements(around: ComplexArray) -> FloatArray:
    """Return how often each row of 1 + L, shape (…, n), turns about zero, less the turn between its ends."""
    turned = np.unwrap(np.angle(around), axis=-1)
    straight = np.angle(around[..., -1]) - np.angle(around[..., 0])
    return np.abs(np.round((turned[..., -1] - turned[..., 0] - straight) / (2.0 * np.pi)))


def _crossings(sign: FloatArray, loop: ComplexArray, hz: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return the loop and the frequency where `sign` passes zero."""
    i = np.nonzero(sign[:-1] * sign[1:] < 0.0)[0]
    share = sign[i] / (sign[i] - sign[i + 1])
    return loop[i] + share * (loop[i + 1] - loop[i]), hz[i] + share * (hz[i + 1] - hz[i])
