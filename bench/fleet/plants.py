"""Joints of the simulated fleet: the second bench with wear, temperature and normal work, no chirps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from independent.bench import Bench, drawn_bench, record_command
from independent.excitations import RATE

from bench.calibration.cases import levels, smoothed
from rsea_ros.records.record import FloatArray, Record

COULOMB = 1.0
"""N m of dry friction that a healthy joint has."""
STIFFNESS_PER_K, FRICTION_PER_K = -3e-4, -0.012
"""Relative change of the spring's stiffness and of all friction for each kelvin above 25 °C."""
RIG = "paper_high_impedance"


def joint(
    seed: int,
    stiffness: float = 1.0,
    friction: float = 1.0,
    gap: float = 0.0,
    delay: float = 0.0,
    ft_gain: float = 1.0,
    temperature: float = 25.0,
) -> Bench:
    """Return a joint: a plant by its seed, with wear.

    stiffness, friction, ft_gain: relative; gap: rad; delay: s; temperature: °C.
    """
    new = drawn_bench(np.random.default_rng(seed))
    warmer = temperature - 25.0
    drag = friction * (1.0 + FRICTION_PER_K * warmer)
    return new.with_values(
        k_s=new.plant.k_s * stiffness * (1.0 + STIFFNESS_PER_K * warmer),
        b_m=new.plant.b_m * drag,
        coulomb=COULOMB * drag,
        gap=gap,
        delay=delay,
        ft_gain=ft_gain,
    )


def handle_loads(n: int, rng: np.random.Generator) -> FloatArray:
    """Return pick and place, N m: levels held for 0.2 to 1.2 s with smooth moves between them."""
    return smoothed(30.0 * levels(n, rng), 0.15)


def step_loads(n: int, rng: np.random.Generator) -> FloatArray:
    """Return commands of a coarse supervisor, N m: levels without a move between them."""
    return 25.0 * levels(n, rng, (0.3, 1.0))


def gait(n: int, rng: np.random.Generator) -> FloatArray:
    """Return a gait, N m: a stride of about 0.9 s with its harmonics, each stride a little different."""
    phase = np.cumsum(2.0 * np.pi * rng.uniform(1.0, 1.2) * (1.0 + 0.05 * _slow_noise(n, rng)) / RATE)
    harmonics = np.arange(1, 9)
    sizes = 22.0 * rng.uniform(0.5, 1.0, 8) / harmonics
    waves = np.sin(phase[:, None] * harmonics + rng.uniform(0.0, 2.0 * np.pi, 8))
    return (waves @ sizes) * (1.0 + 0.1 * _slow_noise(n, rng))


def hold_loads(n: int, rng: np.random.Generator) -> FloatArray:
    """Return loads that are held and slowly changed, N m: hardly any excitation."""
    return smoothed(6.0 * levels(n, rng, (2.0, 4.0)), 1.0)


WORK: dict[str, Callable[[int, np.random.Generator], FloatArray]] = {
    "handling": handle_loads,
    "stepping": step_loads,
    "walking": gait,
    "holding": hold_loads,
}
"""Kinds of normal work; none is made for identification."""


def recording(bench: Bench, kind: str, seed: int, duration: float = 12.0) -> Record:
    """Return the record that a joint logs at some kind of work for so many seconds."""
    rng = np.random.default_rng(seed)
    return record_command(bench, WORK[kind](round(duration * RATE), rng), rng)


def _slow_noise(n: int, rng: np.random.Generator) -> FloatArray:
    """Return noise below about 1 Hz, RMS 1, shape (n,)."""
    slow = smoothed(rng.normal(size=n), 1.0)
    return slow / slow.std()
