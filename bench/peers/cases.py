"""The cases on which programs are compared, and their truth, which none of them sees.

Homes: `sea` and `sea, backlash` are the kind of machine that this project is made for, simulated by
test/independent, which shares no code with it. `pendulum, BAM's friction` is BAM's home: its own law, by its
equations (second_order.py). EMPS is other people's.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from independent.bench import Bench, record_run
from scipy.io import loadmat

from bench.peers.second_order import NAMES, simulate_run
from rsea_ros.records.record import FloatArray

NONE = np.zeros(0)
FINER = 16
"""Steps of the pendulum's simulation in one of second_order.py."""


@dataclass(frozen=True)
class PeerRecord:
    """Samples of a case. noise: of y, in its unit, not a number where unknown. truth: values and cause."""

    name: str
    u: FloatArray
    y: FloatArray
    rate: float
    split: int
    physics: str
    noise: float = float("nan")
    position: FloatArray = field(default_factory=lambda: NONE)
    velocity: FloatArray = field(default_factory=lambda: NONE)
    truth: Mapping[str, float] = field(default_factory=dict)
    cause: str = ""

    @property
    def channel(self) -> str:
        """The measured channel that y is."""
        return "ft" if self.physics == "sea" else "position"


def _sea(name: str, cause: str, **hidden: float) -> PeerRecord:
    values = {"j_m": 1.08 * 0.953, "b_m": 0.93 * 23.088, "k_s": 1.02 * 1530.456, **hidden}
    bench = Bench().with_values(**values)
    plant = bench.plant
    record = record_run(bench, 11, "chirp_noise", 20.0)
    truth = {"inertia": plant.j_m + plant.j_sc, "damping": plant.b_m + plant.b_s, "stiffness": plant.k_s}
    y, position, velocity = (np.array(record[n].y) for n in ("ft", "position", "velocity"))
    u = np.array(record["command"].y)
    split = 3 * len(u) // 4
    return PeerRecord(name, u, y, 280.0, split, "sea", 0.03, position, velocity, truth, cause)


def sea() -> PeerRecord:
    """A bench with wrong nominal values and nothing else."""
    return _sea("sea", "")


def sea_backlash() -> PeerRecord:
    """4 mrad of play, and a spring that is 15.6 % stiffer than stated."""
    return _sea("sea, backlash", "backlash", gap=4.0e-3, k_s=1.156 * 1530.456)


def pendulum() -> PeerRecord:
    """A pendulum with BAM's friction: Coulomb, Stribeck and load-dependent parts."""
    rate, n = 200.0, 4000
    truth = {"inertia": 0.165, "damping": 0.06, "gravity": 2.7}
    friction = {"friction": 0.25, "stribeck": 0.2, "stribeck_velocity": 0.3, "alpha": 1.35}
    friction |= {"load_motor": 0.08, "load_external": 0.12}
    rng = np.random.default_rng(5)
    t = np.arange(n) / rate
    lines = np.arange(1, 41) * 0.1
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lines))
    u = np.sin(2.0 * np.pi * t[:, None] * lines + phases) @ (1.0 / np.sqrt(lines))
    u *= 1.6 / u.std()
    p = np.array([{**dict.fromkeys(NAMES, 0.0), **truth, **friction}[name] for name in NAMES])
    q = simulate_run(p, np.repeat(u, FINER), 1.0 / rate / FINER, False)[FINER - 1 :: FINER]
    velocity = np.gradient(q, 1.0 / rate) + 0.02 * rng.normal(size=n)
    y, noise = q + 5e-4 * rng.normal(size=n), 5e-4
    name, cause, split = "pendulum, BAM's friction", "friction", 3 * n // 4
    return PeerRecord(name, u, y, rate, split, "joint", noise, y, velocity, truth, cause)


def emps(data: Path) -> PeerRecord:
    """The identification record at 100 Hz, force as input; after 16 s held out, a free run."""
    held = loadmat(data / "emps" / "DATA_EMPS.mat")
    force = np.ravel(held["vir"]) * float(np.ravel(held["gtau"])[0])
    n = len(force) // 10
    u, y = force[: 10 * n].reshape(n, 10).mean(axis=1), np.ravel(held["qm"])[9 : 10 * n : 10].astype(float)
    published = {"inertia": 95.109, "damping": 203.503}
    return PeerRecord("emps", u, y, 100.0, 1600, "drive", position=y, truth=published)


SIMULATED: tuple[Callable[[], PeerRecord], ...] = (sea, sea_backlash, pendulum)
REAL: tuple[Callable[[Path], PeerRecord], ...] = (emps,)
