"""The least that a record needs for a diagnosis; other defects are faults to be reported, not refused."""

from __future__ import annotations

import numpy as np

from rsea_ros.checks.moved_spans import is_still
from rsea_ros.documents.units import plain
from rsea_ros.errors import IdentificationError
from rsea_ros.model.pace import check_pace
from rsea_ros.records.fault_kinds import FAULT_KINDS
from rsea_ros.records.record import UNITS, Channel, Record

_FEWEST = 0.1
"""Of a channel's stamps: where fewer rise the clock stood, and the messages were not each sent ten times."""
SHORTEST = 4.0
"""s of commands: four blocks of every set (diagnosis/data_split.py) of a quarter of a second each."""


def check_diagnosable(record: Record) -> None:
    """Raise IdentificationError for a record without commands, too short, without motion or in reverse."""
    driving = record.driving
    if driving is None:
        have = ", ".join(record.channels) or "nothing"
        raise IdentificationError(
            f"{record.source}: no command, expected the torques that drove the run beside {have}"
        )
    for name, channel in record.channels.items():
        if len(channel) < 2 or _rises_rarely(channel):
            raise IdentificationError(
                f"{record.source}: {name}: {len(channel)} samples, expected rising stamps: "
                "stamp each message when its value takes effect or was measured"
            )
    check_pace(record)
    length = float(np.ptp(driving.t))
    if length < SHORTEST:
        raise IdentificationError(
            f"{record.source}: {length:.3g} s of commands, expected {SHORTEST:g} s or more"
        )
    measured = [c for n, c in record.channels.items() if n not in ("command", "reference")]
    if not measured:
        left_out = "; ".join(f"{f.channel}: {FAULT_KINDS[f.kind]}" for f in record.faults)
        reason = f" ({left_out})" if left_out else ""
        raise IdentificationError(
            f"{record.source}: no measurement beside the command{reason}, expected one of ft, position and "
            "velocity, stamped by the command's clock"
        )
    if all(_constant(c) for c in measured):
        raise IdentificationError(
            f"{record.source}: every measured channel holds one value, expected motion: "
            "is the drive enabled, are the sensors alive?"
        )
    require_motion(record)


def require_motion(record: Record) -> None:
    """Raise IdentificationError for a record in which the command never changes and nothing moves."""
    command = record.driving
    if command is None or not len(command) or not _constant(command) or not is_still(record):
        return
    unit = UNITS["command" if "command" in record else "reference"]
    raise IdentificationError(
        f"{record.source}: the command stays at {command.y[0]:g} {plain(unit)} and nothing moves, "
        "expected a run in which the command excites the machine"
    )


def _rises_rarely(channel: Channel) -> bool:
    """Return whether most stamps neither rise nor repeat the one before, or hardly any differ."""
    step = np.diff(channel.t)
    rising = np.count_nonzero(step > 0.0)
    return bool(rising < np.count_nonzero(step < 0.0) or rising < _FEWEST * len(channel))


def _constant(channel: Channel) -> bool:
    finite = channel.y[np.isfinite(channel.y)]
    return not len(finite) or float(np.ptp(finite)) == 0.0
