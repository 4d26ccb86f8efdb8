"""The provenance of the files that a verb writes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from rsea_ros.model.rig_file import rig_path
from rsea_ros.report.provenance import Provenance, provenance_of


def provenance(verb: str, bags: Sequence[str], rig: str) -> Provenance:
    """Return version, date and command line, with the hashes of some bags and a rig."""
    return provenance_of(["rsea", verb, *sys.argv[2:]], [*map(Path, bags), rig_path(rig)])
