"""Records, documents, files, errors and processes: what every package outside of this one builds on."""

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.strict_yaml import NEEDED, Key, mapping, names, only_keys, table, text
from rsea_ros.documents.units import STANDARD_GRAVITY, plain, with_unit
from rsea_ros.documents.wording import (
    brief,
    did_you_mean,
    in_docstring,
    list_names,
    no_utf_8,
    printable,
    quote,
)
from rsea_ros.errors import BenchmarkError, FieldError, OutputError, ParameterError, RigError
from rsea_ros.outputs.files import (
    Destination,
    NewFiles,
    check_free,
    make_folder,
    unused_path,
    write_file,
    write_new,
)
from rsea_ros.processes import STOPPING, Stopped, deaf_to_interrupts, start, stop
from rsea_ros.progress import Progress
from rsea_ros.records.record import COMMANDS, UNITS, Channel, Fault, FloatArray
from rsea_ros.records.statistics import MAD_TO_SD, Z95
from rsea_ros.version import version

__all__ = [
    "COMMANDS", "MAD_TO_SD", "NEEDED", "STANDARD_GRAVITY", "STOPPING", "UNITS", "Z95", "BenchmarkError",
    "Channel", "Destination", "Fault", "FieldError", "FloatArray", "Key", "NewFiles", "OutputError",
    "ParameterError", "Progress", "RigError", "Stopped", "brief", "check_free", "deaf_to_interrupts",
    "did_you_mean", "in_docstring", "list_names", "make_folder", "mapping", "names", "no_utf_8",
    "only_keys", "plain", "printable", "quote", "start", "stop", "strict_yaml", "table", "text",
    "unused_path", "version", "with_unit", "write_file", "write_new",
]  # fmt: skip
