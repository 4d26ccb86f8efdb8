"""How far a played export is from our own simulation of the same rig, in times the sensor's noise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import UNITS, Channel, FloatArray, Record

RATE = 250.0
"""Hz, of the commands that are played."""
REFINE = 4
"""Our steps are so much shorter here: the difference is to be the export's, not that of the step."""
CHANNELS = ("ft", "position", "velocity", "deflection")


@dataclass(frozen=True)
class Difference:
    """Of a channel: rms of the difference and of the channel itself, and the sensor's noise, in `unit`."""

    channel: str
    unit: str
    rms: float
    signal: float
    noise: float

    @property
    def times_noise(self) -> float:
        """Return the difference over the noise."""
        return self.rms / self.noise


def ours(rig: Rig, command: FloatArray, rate: float) -> dict[str, FloatArray]:
    """Return the measurements of our simulation of a rig at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop. rate: Hz.
    """
    t = np.arange(len(command)) / rate
    driven = "command" if rig.loop is None else "reference"
    names = [name for name in CHANNELS if rig.measures(name)]
    asked = {name: Channel(t, np.zeros(len(t))) for name in names}
    return simulate(rig, Record({driven: Channel(t, command), **asked}), refine=REFINE)


def losses(
    rig: Rig, omitted: Iterable[str], mine: Mapping[str, FloatArray], command: FloatArray, rate: float
) -> dict[str, Difference]:
    """Return what each omitted effect of a rig changes, in the channel where it changes most.

    mine: of the whole rig, as `ours` gives it. command: N m or rad. rate: Hz.
    """
    lost = {}
    names = set(omitted)
    for name in (effect.name for effect in rig.effects if effect.name in names):
        without = rig.with_effects(*(effect for effect in rig.effects if effect.name != name))
        apart = differences(rig, mine, ours(without, command, rate))
        if apart:
            lost[name] = max(apart, key=lambda one: one.times_noise)
    return lost


def differences(
    rig: Rig, mine: Mapping[str, FloatArray], theirs: Mapping[str, FloatArray]
) -> tuple[Difference, ...]:
    """Return the difference of each channel whose noise the rig states, N samples against N."""
    differences_found = []
    for name in CHANNELS:
        noise = rig.sensors[name].noise if name in rig.sensors else 0.0
        if noise > 0.0 and name in mine and name in theirs:
            apart = float(np.sqrt(np.mean((theirs[name] - mine[name]) ** 2)))
            apart = apart if math.isfinite(apart) else math.inf
            differences_found.append(Difference(name, UNITS[name], apart, float(np.std(mine[name])), noise))
    return tuple(differences_found)
