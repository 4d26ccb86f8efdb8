"""A machine similar to another: its torques, stiffnesses and inertias are scaled by one factor.

Angles and times stay, so it moves alike, and its diagnosis is the same in units of its torques.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.effects.effect import Effect
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

_TORQUES = {"N m": 1, "N m/rad": 1, "N m s/rad": 1, "N m s^2/rad^2": 1, "kg m^2": 1, "1/(N m)": -1}
"""Power of a torque in each unit; 0 in others."""


def factor(unit: str, times: float) -> float:
    """Return the factor by which a number of a unit grows on a machine with the torque scaled."""
    return float(times ** _TORQUES.get(unit, 0))


def similar(rig: Rig, times: float) -> Rig:
    """Return a rig with the torque scaled, its sensors' noise included."""
    values = {n: v * factor(rig.unit(n), times) for n, v in rig.values().items()}
    sensors = {
        n: replace(s, noise=s.noise * times, quantum=s.quantum * times) if n in ("ft", "motor_torque") else s
        for n, s in rig.sensors.items()
    }
    return replace(rig.with_values(values), sensors=sensors)


def similar_parameters(effect: Effect, parameters: Mapping[str, float], times: float) -> dict[str, float]:
    """Return the parameters of an effect on a machine with the torque scaled."""
    return {p.name: parameters[p.name] * factor(p.unit, times) for p in effect.parameters}


def command(times: float, duration: float = 8.0, rate: float = 280.0) -> Channel:
    """Return a chirp (N m) from 0.2 to 40 Hz with noise, 20 N m on the machine itself."""
    t = np.arange(round(rate * duration)) / rate
    chirp = np.sin(2 * np.pi * (0.2 + 39.8 * t / (2 * duration)) * t)
    return Channel(t, 20.0 * times * (chirp + np.random.default_rng(1).standard_normal(len(t)) / 6))


def record_with(rig: Rig, effect: Effect, times: float, duration: float = 8.0) -> Record:
    """Return the record of a similar machine with a typical effect of its size, the same noise for all."""
    machine = similar(rig, times)
    setting = EffectSetting(effect.name, similar_parameters(effect, effect.typical, times))
    return synthesize(machine.with_effects(setting), command(times, duration), seed=5)
