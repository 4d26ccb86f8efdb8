"""Delays, lags and gains that an extended model has on its way from command to torque and in its sensor.

    on the torque: gain exp(-delay s) / (time_constant s + 1)      on ft: 1 / (time_constant s + 1)

The law does not know them; the margins do.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.control.sampled import FT, Sampled, responses
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig
from rsea_ros.signals import ComplexArray, FloatArray

ON_TORQUE = ("command_delay", "current_loop_lag", "torque_constant_error")
ON_FT = ("ft_sensor_lag", "ft_gain_error")


def lagging(rig: Rig, plant: Sampled, hz: FloatArray) -> ComplexArray:
    """Return the response of a sampled rig with those of its effects that lag, shape (3, n)."""
    response = responses(plant, hz)
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    for setting in rig.effects:
        if setting.name in (*ON_TORQUE, *ON_FT):
            value = effect_named(setting.name).vector(setting.parameters)[0]
            response[slice(None) if setting.name in ON_TORQUE else FT] *= _factor(setting.name, value, s)
    return response


def _factor(name: str, value: float, s: ComplexArray) -> ComplexArray:
    if name.endswith("_lag"):
        return 1.0 / (value * s + 1.0)
    return np.exp(-value * s) if name == "command_delay" else value * np.ones_like(s)
