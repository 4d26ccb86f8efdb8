"""Steps of Runge and Kutta's method, anew wherever the held command changes, also within a hold."""

import numpy as np
from independent.equations import SIZE, right_hand_side
from numba import njit


def _pieces(delay: float, period: float) -> tuple[int, float]:
    """Return by how many whole holds, and then by what part of one, the command comes late."""
    whole = int(delay / period)
    return whole, delay / period - whole


@njit(cache=True)
def _rk4(x, t, length, steps, u, knock, p, k1, k2, k3, k4):
    """Advance x by `length` seconds in `steps` classical Runge-Kutta steps."""
    h = length / steps
    for _ in range(steps):
        right_hand_side(k1, t, x, u, knock, p)
        right_hand_side(k2, t + 0.5 * h, x + 0.5 * h * k1, u, knock, p)
        right_hand_side(k3, t + 0.5 * h, x + 0.5 * h * k2, u, knock, p)
        right_hand_side(k4, t + h, x + h * k3, u, knock, p)
        for i in range(x.size):
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        t += h


@njit(cache=True)
def _march(command, knock, period, whole, part, steps, p, states, held):
    """Fill states (n, SIZE) and the command in force (n,) at the end of every hold."""
    x = np.zeros(SIZE)
    k1, k2, k3, k4 = np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE)
    first = int(np.ceil(part * steps))
    for k in range(command.size):
        late = command[k - whole - 1] if k > whole else 0.0
        now = command[k - whole] if k >= whole else 0.0
        if first > 0:
            _rk4(x, k * period, part * period, first, late, knock[k], p, k1, k2, k3, k4)
        rest = (1.0 - part) * period
        _rk4(x, k * period + part * period, rest, max(steps - first, 1), now, knock[k], p, k1, k2, k3, k4)
        for i in range(SIZE):
            states[k, i] = x[i]
        held[k] = now


def run_fixed(command, knock, period, plant, steps=24):
    """Return states (n, SIZE) and commands in force (n,), by Runge-Kutta of order 4 with `steps` a sample."""
    states, held = np.empty((command.size, SIZE)), np.empty(command.size)
    if plant.gap > 0.0 or plant.gear_k > 0.0:
        steps *= 3  # the chassis is light and its contact hard
    _march(command, knock, period, *_pieces(plant.delay, period), steps, plant, states, held)
    return states, held
