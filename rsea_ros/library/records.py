"""`rsea.read_bag` and `rsea.simulate`: the record of a run, recorded or simulated, without ROS."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from msg_adapters import TopicMap, read_record
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record


def read_bag(
    path: str | Path | Sequence[str | Path],
    *,
    namespace: str = "/rsea",
    joint: str | None = None,
    axis: str = "torque.z",
    strict: bool = True,
) -> Record:
    """Return the record of a rosbag2 directory, an .mcap or a .db3 file, or of several files of one run.

    namespace: of the topics. joint: its name, if the messages hold several. axis: axis of the actuator in the
    wrench; a leading `-` reverses it. strict: refuse commands that are missing or not finite, and correct the
    stamps; with False all samples are kept as they were recorded.
    Raises BagError with file, topic, field, value and expected value.
    Not to be confused with `rsea import`, which converts tables to bags.
    """
    return read_record(path, topics=TopicMap(namespace=namespace, joint=joint, axis=axis), strict=strict)


def simulate(
    rig: Rig | str, command: npt.ArrayLike, rate: float | None = None, *, seed: int = 0, noise: bool = True
) -> Record:
    """Return the simulated record of a bench that holds each command for 1 / rate.

    command: motor torque at the gear output, N m, shape (n,); for a rig with a position loop the target, rad.
    rate: of the commands, Hz. seed: of the sensor noise. noise: False for perfect sensors. Measurements are
    stamped at the end of each hold, commands at its beginning. Raises ParameterError for a command or rate
    that is none.
    Not to be confused with predict, which simulates the commands of a record and compares the result.
    """
    given = np.asarray(command)
    if given.dtype.kind not in "iuf" or given.ndim != 1 or len(given) < 2 or not np.isfinite(given).all():
        kind = f"shape {given.shape} of {given.dtype}"
        raise ParameterError(f"command: {kind}, expected (n,) finite torques in N·m with n >= 2 samples")
    values = given.astype(np.float64)
    if rate is None:
        raise ParameterError("rate: not stated, expected that of the commands, Hz")
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"rate = {rate:g} Hz, expected a finite rate > 0")
    return synthesize(load_rig(rig), Channel(np.arange(len(values)) / rate, values), seed=seed, noise=noise)
