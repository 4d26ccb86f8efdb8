"""Sensors that measure nothing and records that show nothing, from the faults of a record."""

from __future__ import annotations

from collections.abc import Iterable

from rsea_ros.records.fault_kinds import MASKED
from rsea_ros.records.record import Fault


def silent_channels(faults: Iterable[Fault]) -> tuple[str, ...]:
    """Return the sensors of which no sample could be used: dead, or masked throughout."""
    whole = (f.channel for f in faults if f.kind == "dead_channel" or (f.kind in MASKED and f.share >= 1.0))
    return tuple(dict.fromkeys(whole))


def is_unexcited(faults: Iterable[Fault]) -> bool:
    """Return whether the command of a record never changes, so that no cause could have shown itself."""
    return any(f.kind == "no_excitation" for f in faults)
