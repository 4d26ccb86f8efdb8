"""Sensor clocks that run so fast or slow that the phases turn within the record: no linear fit sees them.

The lag behind the rig's simulation, followed from second to second (identification/lag_line.py), says how
fast; taken out, the rest is small enough for the linearised fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from rsea_ros.checks.expected import Side
from rsea_ros.checks.linearised_rig import LinearisedFit, Number
from rsea_ros.identification.lag_line import lag_line
from rsea_ros.signals import SENSED, Channel, Record


def clock_rates(compared: Mapping[str, Side], start: float) -> dict[str, float]:
    """Return the rate (s/s) at which channels come later and later than predicted, where a line shows it."""
    lines = {n: lag_line(s.t, s.y, s.p, start) for n, s in compared.items() if n in SENSED}
    return {n: line.rate for n, line in lines.items() if line is not None and line.is_clear}


def at_rates(record: Record, rates: Mapping[str, float]) -> Record:
    """Return the record with the stamps that some channels would have, did their clocks run as the command's.

    rates: s/s by channel, since the first command.
    """
    start = float(record["command"].t[0])
    moved = {n: Channel(c.t - rate * (c.t - start), c.y) for n, rate in rates.items() for c in [record[n]]}
    return record.with_channels(**moved)


def with_rates(linear: LinearisedFit, rates: Mapping[str, float]) -> LinearisedFit:
    """Return the fit of a record at_rates as one of the record with its stamps."""
    drift = {n: Number(d.value + rates.get(n, 0.0), d.sd) for n, d in linear.drift.items()}
    return replace(linear, drift=drift)
