"""RMS of error and torque over the last seconds, and the verdict on them, in constant time: compiled."""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.records.record import FloatArray

LENGTH = 8192
"""Samples that a window can hold: 0.8 s at 10 kHz."""
ROUNDING = 1e-6
"""Part of the window by which a sample at its very beginning is out, so that stamps may be rounded."""
NEWEST, OLDEST, SUM_ERROR, SUM_TORQUE, SUMS = range(5)
"""In `state`, first: rows of the ring, counted without end, and running sums of squares, N^2 m^2."""
NOTHING, PURE, BEYOND = range(3)
TOLERANCE, WINDOW, HYSTERESIS, QUIET, VERDICT, HEARD, SHARE, LAST, STATE = range(SUMS, SUMS + 9)
"""In the state, after the sums of the window: settings, verdict, times (s) and share. One array, for each
argument of a compiled function costs 0.1 us a sample."""
AUDIBLE = 2.0
"""Torque times tolerance that can be judged, in sigmas of the observer's T_p and T_d together."""
AGAIN = 1.0
"""s by which a stamp may be before the last one and of the same run; further back it begins anew."""


def empty_ring() -> FloatArray:
    """Return an empty ring of t, error^2 and torque^2 (s, N^2 m^2)."""
    return np.zeros((LENGTH, 3))


@njit(cache=True, nogil=True, error_model="numpy")
def mean_squares(state, ring, window, t, error, torque):  # type: ignore[no-untyped-def]
    """Process an error and a torque (N m) at t (s); return their mean squares over the window (s), N^2 m^2.

    Sums are recomputed once in a round of the ring, so that rounding does not add up. A sample that is not
    finite is left out.
    """
    if not (np.isfinite(error) and np.isfinite(torque)):
        error, torque = 0.0, 0.0
    row, within = int(state[NEWEST]) % LENGTH, window * (1.0 - ROUNDING)
    ring[row, 0], ring[row, 1], ring[row, 2] = t, error * error, torque * torque
    state[NEWEST] += 1.0
    state[SUM_ERROR] += error * error
    state[SUM_TORQUE] += torque * torque
    while state[OLDEST] < state[NEWEST] - 1.0:
        old = int(state[OLDEST]) % LENGTH
        if t - ring[old, 0] < within and state[NEWEST] - state[OLDEST] < LENGTH:
            break
        state[SUM_ERROR] -= ring[old, 1]
        state[SUM_TORQUE] -= ring[old, 2]
        state[OLDEST] += 1.0
    if row == 0:
        _anew(state, ring)
    count = state[NEWEST] - state[OLDEST]
    return max(state[SUM_ERROR], 0.0) / count, max(state[SUM_TORQUE], 0.0) / count


@njit(cache=True, nogil=True, error_model="numpy")
def _anew(state, ring):  # type: ignore[no-untyped-def]
    state[SUM_ERROR] = state[SUM_TORQUE] = 0.0
    for k in range(int(state[OLDEST]), int(state[NEWEST])):
        state[SUM_ERROR] += ring[k % LENGTH, 1]
        state[SUM_TORQUE] += ring[k % LENGTH, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def judge_error(state, ring, t, distal, proximal, sigma, heard):  # type: ignore[no-untyped-def]
    """Process both torques and the sum of their sigmas (N m) at a later t (s); return the verdict.

    heard: hold the verdict while the torque is too small to be judged. A sigma that is not finite, of an
    observer that does not settle, is a threshold that no torque passes: NOTHING at once.
    """
    if state[LAST] - t > AGAIN:
        state[:SUMS], state[VERDICT] = 0.0, NOTHING
        state[HEARD] = state[LAST] = -math.inf
    if not t > state[LAST]:
        return int(state[VERDICT])
    state[LAST] = t
    error, torque = mean_squares(state, ring, state[WINDOW], t, proximal - distal, distal)
    least = AUDIBLE * sigma / state[TOLERANCE]
    state[SHARE] = math.nan
    if not np.isfinite(sigma):
        state[VERDICT], state[HEARD] = NOTHING, -math.inf
        return NOTHING
    if torque > least * least:
        state[SHARE] = math.sqrt(error / torque)
        state[VERDICT] = _verdict(state)
    if torque > least * least or heard:
        state[HEARD] = t
    elif not t - state[HEARD] <= state[QUIET]:
        state[VERDICT] = NOTHING
    return int(state[VERDICT])


@njit(cache=True, nogil=True, error_model="numpy")
def _verdict(state):  # type: ignore[no-untyped-def]
    slack = 0.0 if state[VERDICT] == NOTHING else state[HYSTERESIS] * state[TOLERANCE]
    if state[SHARE] > state[TOLERANCE] + slack:
        return BEYOND
    if state[SHARE] <= state[TOLERANCE] - slack:
        return PURE
    return int(state[VERDICT])
