"""Delays, lags and gains that an extended model has on its way from command to torque and in its sensor.

Each is the response of an effect where it is linear (Effect.response): at the command it is on the path to
the current, at the motor on all torque, at the F/T sensor on ft. The law does not know them; the margins do.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.control.sampled import FT, Sampled, responses
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray


def lag_responses(rig: Rig, plant: Sampled, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the response of a sampled rig, shape (4, n), and of the path from command to current, (n,)."""
    response, path = responses(plant, hz), np.ones(len(hz), dtype=np.complex128)
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    for setting in rig.effects:
        effect = effect_named(setting.name)
        if effect.response is None:
            continue
        factor = effect.response(effect.vector(setting.parameters), s)
        if effect.port == Port.COMMAND:
            path = path * factor
        else:
            response[FT if effect.port == Port.SENSOR else slice(None)] *= factor
    return response, path
