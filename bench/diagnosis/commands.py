"""Commands of benches, and of machines at work: six kinds, each for a bench of test/independent."""

from collections.abc import Callable, Mapping

import numpy as np
from independent.bench import Bench
from independent.equations import DG, DH, SIZE, G, H
from independent.excitations import RATE, chirp_noise, odd_multisine
from independent.solvers import _pieces, _rk4
from numba import njit

from rsea_ros.records.record import FloatArray

STIFF, DAMPED, STIFFNESS = 900.0, 15.0, 1500.0
"""Of the closed loop on the deflection: gains, N m/rad and N m s/rad, and feed-forward, N m/rad."""


def work(duration: float, rng: np.random.Generator, smooth: bool) -> FloatArray:
    """Return a log of normal work, -1 to 1: levels held for 0.2 to 1.2 s, smoothed moves between if asked."""
    held: list[FloatArray] = []
    n = round(duration * RATE)
    while sum(map(len, held)) < n:
        held.append(np.full(round(rng.uniform(0.2, 1.2) * RATE), rng.uniform(-1.0, 1.0)))
    levels: FloatArray = np.concatenate(held)[:n]
    window = np.hanning(round(0.15 * RATE) + 2)[1:-1]
    return np.convolve(levels, window / window.sum(), mode="same") if smooth else levels


def _work(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    levels = 30.0 * work(duration, rng, smooth=True)
    return levels + rng.normal(size=len(levels))


def _slow_sweep(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    """A sine of 30 N m from 0.1 to 10 Hz."""
    t = np.arange(round(duration * RATE)) / RATE
    growth = np.log(100.0) / duration
    return 30.0 * np.sin(2.0 * np.pi * 0.1 * np.expm1(growth * t) / growth)


def _closed_loop(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    """The commands of a PD loop that follows a log of work in angle, on noisy readings."""
    reference = 25.0 / STIFFNESS * work(duration, rng, smooth=True)
    noise = rng.normal(size=(2, len(reference))) * np.array([[2.0e-5], [5.0e-3]])
    plant = bench.plant._replace(duration=duration)
    steps = 72 if plant.gap > 0.0 or plant.gear_k > 0.0 else 24
    late, limit = _pieces(plant.delay, 1.0 / RATE), bench.outside.saturation
    return _follow(reference, noise, 1.0 / RATE, *late, steps, plant, limit)


@njit(cache=True)
def _follow(reference, noise, period, whole, part, steps, p, limit):
    """Return the commands (n,) of u = STIFF (r - q) - DAMPED q', computed and applied sample by sample."""
    x, commands = np.zeros(SIZE), np.zeros(reference.size)
    k1, k2, k3, k4 = np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE), np.zeros(SIZE)
    first = int(np.ceil(part * steps))
    for k in range(reference.size):
        angle, speed = x[G] - x[H] + noise[0, k], x[DG] - x[DH] + noise[1, k]
        wanted = STIFFNESS * reference[k] + STIFF * (reference[k] - angle) - DAMPED * speed
        commands[k] = min(max(wanted, -68.0), 68.0)
        late = min(max(commands[k - whole - 1], -limit), limit) if k > whole else 0.0
        now = min(max(commands[k - whole], -limit), limit) if k >= whole else 0.0
        if first > 0:
            _rk4(x, k * period, part * period, first, late, 0.0, p, k1, k2, k3, k4)
        rest = (1.0 - part) * period
        _rk4(x, k * period + part * period, rest, max(steps - first, 1), now, 0.0, p, k1, k2, k3, k4)
    return commands


COMMANDS: Mapping[str, Callable[[Bench, float, np.random.Generator], FloatArray]] = {
    "chirp": lambda bench, duration, rng: chirp_noise(duration, rng),
    "multisine": lambda bench, duration, rng: odd_multisine(duration, rng, period=5.0),
    "work": _work,
    "loop": _closed_loop,
    "steps": lambda bench, duration, rng: 30.0 * work(duration, rng, smooth=False),
    "sweep": _slow_sweep,
}
"""Commands of each kind of work, N m."""
