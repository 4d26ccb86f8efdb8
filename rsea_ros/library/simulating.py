"""`rsea.simulate`: the simulated record of a bench, from commands at a fixed rate."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record


def simulate(
    rig: Rig | str, command: npt.ArrayLike, rate: float = 280.0, *, seed: int = 0, noise: bool = True
) -> Record:
    """Return the simulated record of a bench that holds each command for 1 / rate.

    command: motor torque at the gear output, N m, shape (n,); for a rig with a position loop the target, rad.
    rate: Hz. seed: of the sensor noise. noise: False for perfect sensors. Measurements are stamped at the end
    of each hold, commands at its beginning. Raises ParameterError for an invalid command or rate.
    Not to be confused with predict, which simulates the commands of a record and compares the result.
    """
    given = np.asarray(command)
    if given.dtype.kind not in "iuf" or given.ndim != 1 or len(given) < 2 or not np.isfinite(given).all():
        kind = f"shape {given.shape} of {given.dtype}"
        raise ParameterError(f"command: {kind}, expected (n,) finite torques in N·m with n >= 2 samples")
    values = given.astype(np.float64)
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"rate = {rate:g} Hz, expected a finite rate > 0")
    return synthesize(load_rig(rig), Channel(np.arange(len(values)) / rate, values), seed=seed, noise=noise)
