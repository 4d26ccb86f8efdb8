"""The causal filter pair of the pure-torque flag, compiled: one state-variable filter with two outputs.

    high = s^2 / D,   low = w^2 / D,   D = s^2 + sqrt(2) w s + w^2   (Butterworth, power complementary)

For a sine of frequency f high = -(f / f_c)^2 low at every instant, so the ratio of their powers does not
ripple, and it crosses 1 at the corner f_c; of several sines their powers are shares of the whole. Trapezoidal
integration with w = tan(pi f_c dt) keeps the corner, and for every dt: stamps may jitter.
Source: Zavalishin, The Art of VA Filter Design, 2018, section 4.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.records.record import FloatArray

DAMPING = math.sqrt(2.0)
SEEN = 0.45
"""Corner that the filter can have at most, in sample rates."""
LENGTH = 256
"""Samples in the longest window."""


class Pair(NamedTuple):
    """State of the filter: integrators, time of the last sample (s), and squares of the last outputs.

    memory: s_1, s_2, t, next row, rows in use. squares: t (s), high^2, low^2, shape (LENGTH, 3).
    """

    memory: FloatArray
    squares: FloatArray


def empty_pair() -> Pair:
    """Return a pair without samples."""
    return Pair(np.array([0.0, 0.0, np.nan, 0.0, 0.0]), np.zeros((LENGTH, 3)))


@njit(cache=True, nogil=True, error_model="numpy")
def powers(pair, corner, window, t, torque):  # type: ignore[no-untyped-def]
    """Process a torque (N m) at t (s); return the mean squares of high and low over the window (s), N^2 m^2.

    corner: Hz. After a pause that is too long for the corner the pair restarts.
    """
    memory, squares = pair
    dt = t - memory[2]
    memory[2] = t
    if not 0.0 < dt * corner < SEEN:
        memory[0], memory[1], memory[4] = 0.0, torque, 0.0
        return 0.0, torque * torque
    g = math.tan(math.pi * corner * dt)
    high = (torque - (DAMPING + g) * memory[0] - memory[1]) / (1.0 + g * (DAMPING + g))
    band = g * high + memory[0]
    low = g * band + memory[1]
    memory[0], memory[1] = g * high + band, g * band + low
    row = int(memory[3])
    squares[row, 0], squares[row, 1], squares[row, 2] = t, high * high, low * low
    memory[3], memory[4] = (row + 1) % LENGTH, min(memory[4] + 1, LENGTH)
    above = below = 0.0
    count = 0
    while count < memory[4] and t - squares[(row - count) % LENGTH, 0] < window:
        above += squares[(row - count) % LENGTH, 1]
        below += squares[(row - count) % LENGTH, 2]
        count += 1
    return above / count, below / count


NOTHING, PURE, BEYOND = range(3)
CORNER, WINDOW, NOISE_HIGH, NOISE_LOW, SIGMA, SURPRISE, FAINT = range(7)
QUIET, ON, OFF, VALUES, HOLD_ON, HOLD_OFF = range(7, 13)
"""In `limits`. Corner: Hz. Noise: N^2 m^2, while the sigma of the torque is so, N m. Surprise, faint: times
the noise that are a torque, one that begins and one that goes on. On, off: ratios of powers. Times: s."""
VERDICT, HEARD, SINCE, LAST, HIGH, LOW, FELL, FALLS, MEMORY = range(9)
"""In `memory`: verdict, when torque was heard last, since when the powers agree with the verdict, powers;
when the flag fell last, and how often just now."""

FLUTTER, CALM = 2, 0.5
"""Falls, each within so many s of the one before, after which the flag rises only when it could for that
time: a slow torque beside a fast one crosses zero twice a period, and is beyond the edge for a moment."""

DECIDED = 3.0
"""Sigmas by which the powers must lie on one side of the edge."""


@njit(cache=True, nogil=True, error_model="numpy")
def update_flag(pair, limits, memory, t, torque, sigma):  # type: ignore[no-untyped-def]
    """Process a torque (N m) and its sigma at a later t (s), and update the verdict in memory."""
    if t <= memory[LAST]:
        return
    memory[LAST] = t
    if not (math.isfinite(torque) and math.isfinite(sigma)):
        memory[VERDICT], memory[SINCE] = NOTHING, t
        return
    high, low = powers(pair, limits[CORNER], limits[WINDOW], t, torque)
    memory[HIGH], memory[LOW] = high, low
    excess = max(1.0, (sigma / limits[SIGMA]) ** 2)
    noise_high, noise_low = excess * limits[NOISE_HIGH], excess * limits[NOISE_LOW]
    times = limits[SURPRISE] if memory[VERDICT] == NOTHING else limits[FAINT]
    if high > times * noise_high or low > times * noise_low:
        memory[HEARD] = t
    elif t - memory[HEARD] > limits[QUIET]:
        memory[VERDICT], memory[SINCE] = NOTHING, t
        return
    wanted = _next_verdict(limits, memory[VERDICT], high - noise_high, low - noise_low, noise_high, noise_low)
    hold = limits[HOLD_OFF]
    if wanted == PURE:
        hold = max(limits[HOLD_ON], CALM) if memory[FALLS] >= FLUTTER else limits[HOLD_ON]
    if wanted == memory[VERDICT]:
        memory[SINCE] = t
    elif t - memory[SINCE] >= hold:
        if wanted == BEYOND and memory[VERDICT] == PURE:
            memory[FALLS] = memory[FALLS] + 1.0 if t - memory[FELL] < CALM else 1.0
            memory[FELL] = t
        memory[VERDICT], memory[SINCE] = wanted, t


@njit(cache=True, nogil=True, error_model="numpy")
def _next_verdict(limits, verdict, high, low, noise_high, noise_low):  # type: ignore[no-untyped-def]
    """Return the verdict of the powers without their noise, or the present one when they are too small."""
    spread_high = 2.0 * noise_high**2 + 4.0 * noise_high * max(high, 0.0) / limits[VALUES]
    spread_low = 2.0 * noise_low**2 + 4.0 * noise_low * max(low, 0.0) / limits[VALUES]
    off, on = limits[OFF], limits[ON]
    if high - off * low > DECIDED * math.sqrt(spread_high + off * off * spread_low):
        return BEYOND
    if on * low - high > DECIDED * math.sqrt(spread_high + on * on * spread_low):
        return PURE
    return int(verdict)
