"""Delays, lags and gains that an extended model has on its way from command to torque and in its sensor.

    on the path to the current: exp(-delay s) / (time_constant s + 1)
    on the torque: gain                      on ft: gain / (time_constant s + 1)

The law does not know them; the margins do.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.control.sampled import FT, Sampled, responses
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig
from rsea_ros.signals import ComplexArray, FloatArray

ON_PATH = ("command_delay", "current_loop_lag")
ON_TORQUE = ("torque_constant_error",)
ON_FT = ("ft_sensor_lag", "ft_gain_error")


def lagging(rig: Rig, plant: Sampled, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the response of a sampled rig, shape (3, n), and of the path from command to current, (n,)."""
    response, path = responses(plant, hz), np.ones(len(hz), dtype=np.complex128)
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    for setting in rig.effects:
        if setting.name in (*ON_PATH, *ON_TORQUE, *ON_FT):
            value = effect_named(setting.name).vector(setting.parameters)[0]
            factor = _factor(setting.name, value, s)
            if setting.name in ON_PATH:
                path = path * factor
            else:
                response[slice(None) if setting.name in ON_TORQUE else FT] *= factor
    return response, path


def _factor(name: str, value: float, s: ComplexArray) -> ComplexArray:
    if name.endswith("_lag"):
        return 1.0 / (value * s + 1.0)
    return np.exp(-value * s) if name == "command_delay" else value * np.ones_like(s)
