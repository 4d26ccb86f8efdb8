"""The provenance of the files that a verb writes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rsea_ros.model.rig_file import rig_path
from rsea_ros.report.result_files import Provenance, provenance_of


def provenance(verb: str, files: Sequence[str | Path], rig: str = "") -> Provenance:
    """Return version, date and command line, with the hashes of some files and of a rig, if there is one."""
    inputs = [*map(Path, files), *([rig_path(rig)] if rig else [])]
    return provenance_of(["rsea", verb, *sys.argv[2:]], inputs)
