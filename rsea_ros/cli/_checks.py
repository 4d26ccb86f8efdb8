"""The checks before a fit; amber and red findings are printed first and kept with the results."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.checks.carried import note_unused, require_motion, with_faults
from rsea_ros.checks.check import check_record
from rsea_ros.checks.finding import Findings, unused_sentence
from rsea_ros.cli._terminal import say
from rsea_ros.model.extent import check_pace
from rsea_ros.model.inverse import is_inverse, require_position
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record
from rsea_ros.report.check import warnings


def check_records(
    records: Sequence[Record], rig: Rig, axis: str, *, quiet: bool, masks: bool
) -> list[Record]:
    """Return the records, each with the faults that the checks found; a dead channel is left out.

    Prints a line for each warning unless quiet. masks: see with_faults.
    Raises IdentificationError if nothing moves, or a position is lacking that the rig is judged by.
    """
    for record in records:
        check_pace(record)
        require_motion(record)
        if is_inverse(rig):
            require_position(record)
    checks = [check_record(record, rig, axis) for record in records]
    if not quiet:
        print_warnings(checks, rig)
    kept = [with_faults(note_unused(r, rig), f, masks=masks) for r, f in zip(records, checks, strict=True)]
    if not quiet:
        for sentence in dict.fromkeys(filter(None, (unused_sentence(r, rig) for r in records))):
            say(sentence)
    return kept


def print_warnings(checks: Sequence[Findings], rig: Rig) -> None:
    """Print the amber and red findings, each line once, below the name of the rig."""
    lines = dict.fromkeys(line for findings in checks for line in warnings(findings))
    if lines:
        print(f"compared with rig {rig.name}:")
    for line in lines:
        say(line, indent=2)
