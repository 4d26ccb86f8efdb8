"""An excitation played in an FMU, by FMPy."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.exports.difference import CHANNELS, RATE
from rsea_ros.model.rig import Rig
from rsea_ros.outputs.files import write_new
from rsea_ros.records.record import FloatArray


def play_fmu(archive: bytes, rig: Rig, command: FloatArray) -> dict[str, FloatArray]:
    """Return the measurements of the exported rig at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop, at RATE. Raises ParameterError without FMPy.
    """
    try:
        from fmpy import simulate_fmu
        from fmpy.fmi1 import FMICallException
    except ImportError:
        raise ParameterError(
            "playing the FMU needs the package fmpy, which is not installed: pip install fmpy, or --no-play"
        ) from None
    driven = "torque_command" if rig.loop is None else "desired_position"
    t = np.arange(len(command)) / RATE
    given = np.array(list(zip(t, command, strict=True)), dtype=[("time", "f8"), (driven, "f8")])
    names = [name for name in CHANNELS if rig.measures(name)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.fmu"
        write_new(file, archive)
        try:
            result = simulate_fmu(
                str(file), stop_time=float(t[-1]), step_size=1.0 / RATE, output_interval=1.0 / RATE,
                input=given, output=names, validate=True, start_values={"duration": len(t) / RATE},
            )  # fmt: skip
        except FMICallException as error:
            raise ParameterError(f"FMPy: {' '.join(str(error).split())}") from None
    return {name: np.asarray(result[name], np.float64) for name in names}
