"""A rig as an FMU for co-simulation, FMI 3: our own step in an archive that other programs play.

Source: FMI 3.0.2 specification, section 4 (co-simulation); pythonfmu3 builds the archive.
"""

import tempfile
from pathlib import Path

from rsea_ros.errors import ParameterError
from rsea_ros.exports.others import Export, coverage_lines, omitted_sensors
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import rig_text
from rsea_ros.model.simulation import build
from rsea_ros.outputs.files import write_new

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
        return Export("fmu", ".fmu", Path(made).read_bytes(), says, left)
