"""A recording read, checked, identified and diagnosed, a step at a time: the door does them at once."""

from msg_adapters.bags import read_contents
from msg_adapters.decoding import DIAGNOSTICS, mean_temperature
from msg_adapters.reading import record_from
from msg_adapters.tables import import_record
from rsea_ros.checks.carried import check_diagnosable, require_motion, with_faults
from rsea_ros.checks.check import check_record
from rsea_ros.checks.faults import check
from rsea_ros.checks.stamp_findings import command_band
from rsea_ros.diagnosis.diagnose import best_single_effect, diagnose
from rsea_ros.identification.identify import identify
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.solver import on_cores
from rsea_ros.model.extent import bound_values, check_pace
from rsea_ros.report.diagnosis.page import diagnosis_json, diagnosis_report
from rsea_ros.report.identification import identification_json

__all__ = [
    "DIAGNOSTICS", "ParameterEstimate", "best_single_effect", "bound_values", "check", "check_diagnosable",
    "check_pace", "check_record", "command_band", "diagnose", "diagnosis_json", "diagnosis_report",
    "identification_json", "identify", "import_record", "mean_temperature", "on_cores", "read_contents",
    "record_from", "require_motion", "with_faults",
]  # fmt: skip
