"""What an export target is made of."""

from rsea_ros.effects._friction import PRESLIDING
from rsea_ros.exports import others
from rsea_ros.exports.others import Export, coverage_lines, identifier, omitted_sensors
from rsea_ros.exports.verification import CHANNELS, RATE
from rsea_ros.model.equations import gear_inertia, rotor_inertia, train_ratio, with_structure
from rsea_ros.model.simulation import build, run
from rsea_ros.model.step import OUTPUTS

__all__ = [
    "CHANNELS", "OUTPUTS", "PRESLIDING", "RATE", "Export", "build", "coverage_lines", "gear_inertia",
    "identifier", "omitted_sensors", "others", "rotor_inertia", "run", "train_ratio", "with_structure",
]  # fmt: skip
