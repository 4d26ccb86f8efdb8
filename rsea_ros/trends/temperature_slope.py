"""The change of a parameter per kelvin, estimated across the joints of a fleet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.trends.day_effect import DayEffect

_UNKNOWN = 0.05
"""Per K, one sigma, where the fleet does not say: grease loses 5 % of its drag in a kelvin at most."""


def fleet_prior(effects: Sequence[DayEffect]) -> tuple[float, float]:
    """Return mean and sd, per K and relative, of a parameter's temperature slope over the joints of a fleet.

    Random effects by DerSimonian and Laird (1986), never known better than from two joints. Wear beside a
    season that warms would be taken for temperature by one joint alone; the others say how much of it is.
    """
    known = [e for e in effects if np.isfinite(e.per_kelvin_sd) and e.per_kelvin_sd > 0.0]
    if len(known) < 2:
        return 0.0, _UNKNOWN
    value = np.array([e.per_kelvin for e in known])
    variance = np.array([e.per_kelvin_sd**2 for e in known])
    w = 1.0 / variance
    mean = float(np.sum(w * value) / np.sum(w))
    room = float(np.sum(w) - np.sum(w**2) / np.sum(w))
    between = max(0.0, (float(np.sum(w * (value - mean) ** 2)) - (len(known) - 1)) / room)
    w = 1.0 / (variance + between)
    mean = float(np.sum(w * value) / np.sum(w))
    return mean, float(np.sqrt(between + 1.0 / np.sum(w)))
