"""The bench on which every effect is tried: commands, and simulations with one effect on."""

from collections.abc import Mapping

import numpy as np

from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.drive import Drive, drive_from
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import Channel, Record

RIG = load_rig("paper_high_impedance")
ON_THE_BENCH = [e for e in catalogue().values() if e.name != "gravity_error"]
"""Every effect that a bench with both ends clamped can have; test_variants.py has the other."""
SIGNALS = ("ft", "position", "velocity")
NOISE = {"ft": 0.03, "position": 6.2e-6, "velocity": 2.1e-4, "motor_torque": 0.06}
"""One sigma of each sensor of the rig, its quantum counted as quantum / sqrt(12)."""


def command(rate: float, duration: float, amplitude: float = 20.0, highest: float = 40.0) -> Channel:
    """Return a chirp (N m) from 0.2 Hz to `highest`, with noise of a sixth of its amplitude."""
    t = np.arange(round(rate * duration)) / rate
    chirp = np.sin(2 * np.pi * (0.2 + (highest - 0.2) * t / (2 * duration)) * t)
    noise = np.random.default_rng(1).standard_normal(len(t)) / 6
    return Channel(t, amplitude * (chirp + noise))


def record_of(commanded: Channel, start: tuple[float, float] = (0.0, 0.0)) -> Record:
    """Return a record that asks for every channel at the end of each hold; start: rad and rad/s."""
    stamps, blank = commanded.t + commanded.t[1], np.zeros(len(commanded))
    channels = {n: Channel(stamps, blank.copy()) for n in ("ft", "motor_torque")}
    at_start = (np.concatenate([[value], blank[1:]]) for value in start)
    channels |= {n: Channel(stamps, y) for n, y in zip(("position", "velocity"), at_start, strict=True)}
    return Record({"command": commanded, **channels}, source="effect bench")


def drive(rate: float = 280.0, duration: float = 6.0, amplitude: float = 20.0, refine: int = 1) -> Drive:
    """Return the chirp laid on the grid of the step."""
    return drive_from(record_of(command(rate, duration, amplitude)), refine=refine)


def simulate(driven: Drive, name: str = "", parameters: Mapping[str, float] | None = None,
             rig: Rig = RIG) -> dict[str, np.ndarray]:  # fmt: skip
    """Return every channel of the bench, with one effect on, or none."""
    settings = () if parameters is None else (EffectSetting(name, parameters),)
    return simulate_drive(rig.with_effects(*settings), driven)


def difference(a: Mapping[str, np.ndarray], b: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a - b of position, velocity and ft in units of their noise, shape (3 n,)."""
    return np.concatenate([(a[n] - b[n]) / NOISE[n] for n in SIGNALS])


def rms(values: np.ndarray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
