"""A rig as an FMU for co-simulation, FMI 3: our own step in an archive that other programs play.

Source: FMI 3.0.2 specification, section 4 (co-simulation); pythonfmu3 builds the archive.
"""

import tempfile
from pathlib import Path

import numpy as np

from rsea_ros import Rig
from rsea_ros.extension.base import FloatArray, ParameterError, write_new
from rsea_ros.extension.rigs import rig_text
from rsea_ros.extension.target import CHANNELS, RATE, Export, build, coverage_lines, omitted_sensors

STEP = 1e-4
"""s. Any step will do to see whether the rig can be built."""
SLAVE = Path(__file__).with_name("_fmu_slave.py")


def export_fmu(rig: Rig) -> Export:
    """Return the archive of a rig. Raises ParameterError without pythonfmu3, and as a simulation does."""
    build(rig, STEP, 1.0, in_loop=rig.loop is not None)  # otherwise the FMU would refuse it only when played
    try:
        from pythonfmu3 import FmuBuilder
    except ImportError:
        raise ParameterError(
            "--fmu needs the package pythonfmu3, which is not installed: pip install pythonfmu3"
        ) from None
    says = {"bench": "our own compiled step, co-simulation; the Python that plays it needs rsea_ros"}
    says |= {one.name: "in the step; its sizes are parameters" for one in rig.effects}
    if rig.linear:
        says["linear rig"] = "m and N stand in the place of rad and N·m"
    left = omitted_sensors(rig, "outputs are what perfect instruments read")
    with tempfile.TemporaryDirectory() as folder:
        files = {"rig.yaml": rig_text(rig), "coverage.txt": "\n".join(coverage_lines(says, left))}
        for name, text in files.items():
            write_new(Path(folder, name), text)
        made = FmuBuilder.build_FMU(SLAVE, dest=folder, project_files=[Path(folder, name) for name in files])
        return Export("fmu", ".fmu", Path(made).read_bytes(), says, left, play_fmu)


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
