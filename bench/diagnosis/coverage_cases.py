"""Records for the coverage table: one effect, one kind of work, one severity, on test/independent.

That plant shares no code with the project. Six kinds of work: commands of benches, and motions of
machines at work.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from independent.bench import Bench, drawn_bench, record_command
from independent.equations import DG, DH, SIZE, G, H
from independent.excitations import chirp_noise, odd_multisine
from independent.hidden import hide
from independent.severities import drawn_parameters
from independent.solvers import _pieces, _rk4
from numba import njit

from bench.calibration.cases import RATE, work
from bench.diagnosis.cases import RIG
from bench.diagnosis.played import Played
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import FloatArray

RIG_VALUES = {
    "rotor.reflected_inertia": "j_m",
    "rotor.reflected_damping": "b_m",
    "spring.stiffness": "k_s",
    "spring.damping": "b_s",
}
"""Value of the rig, and its name on the second bench."""
STIFF, DAMPED = 900.0, 15.0
"""Gains of the closed loop on the deflection, N m/rad and N m s/rad."""
SOFTNESS = 25.0 / 1500.0
"""Largest target of the closed loop, rad."""


def make_record(effect: str, excitation: str, severity: str, seed: int, duration: float) -> Played:
    """Return a record (duration in s) of a hidden effect with its truth."""
    rng = np.random.default_rng([seed, *map(ord, effect + excitation + severity)])
    parameters = drawn_parameters(effect, severity, rng)
    drawn = drawn_bench(rng)
    bench = hide(drawn, effect, parameters)
    record = record_command(bench, COMMANDS[excitation](bench, duration, rng), rng)
    values = {name: getattr(drawn.plant, n) for name, n in RIG_VALUES.items()}
    return Played(record, load_rig(RIG), (), (effect,), {effect: parameters}, values)


def _work(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    levels = 30.0 * work(duration, rng, smooth=True)
    return levels + rng.normal(size=len(levels))


def _steps(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    return 30.0 * work(duration, rng, smooth=False)


def _slow_sweep(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    """A sine of 30 N m from 0.1 to 10 Hz."""
    t = np.arange(round(duration * RATE)) / RATE
    growth = np.log(100.0) / duration
    return 30.0 * np.sin(2.0 * np.pi * 0.1 * np.expm1(growth * t) / growth)


def _closed_loop(bench: Bench, duration: float, rng: np.random.Generator) -> FloatArray:
    """The commands of a PD loop that follows a log of work in angle, on noisy readings."""
    reference = SOFTNESS * work(duration, rng, smooth=True)
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
        wanted = 1500.0 * reference[k] + STIFF * (reference[k] - angle) - DAMPED * speed
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
    "steps": _steps,
    "sweep": _slow_sweep,
}
"""Commands of each kind of work, N m."""
