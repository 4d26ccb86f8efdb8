"""Sensor clocks that run so fast or slow that the phases turn within the record: no linear fit sees them.

The lag behind the rig's simulation, followed from second to second (identification/lag_line.py), says how
fast; taken out, the rest is small enough for the linearised fit. Where the rig misfits even so, the line
itself is the number: a cause in the machine moves the lags of all sensors, a clock only those of its sensor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.checks.expected import Side
from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.linearised_rig import LinearisedFit, Number
from rsea_ros.checks.rig_findings import JOINT, SURE, drift_finding
from rsea_ros.identification.lag_line import BLOCK, LEAST_RISE, SCATTER, LagLine, lag_line
from rsea_ros.records.record import SENSED, Channel, Record

_STEEPEST = 1.8e-3
"""s/s. The lag is followed from block to block up to 2 ms/s; no line near that is trusted."""
_STRAIGHT = 0.2
"""As SCATTER, beside a misfit of the rig."""


def lag_lines(compared: Mapping[str, Side], start: float) -> dict[str, LagLine]:
    """Return the line through the lags of every sensor that shows one. start: of the record, s."""
    lines = {n: lag_line(s.t, s.y, s.p, start) for n, s in compared.items() if n in SENSED}
    return {n: line for n, line in lines.items() if line is not None}


def clock_rates(lines: Mapping[str, LagLine]) -> dict[str, float]:
    """Return the rate (s/s) at which channels come later and later than predicted, where a line shows it."""
    return {n: line.rate for n, line in lines.items() if _rises(line, SCATTER)}


def _rises(line: LagLine, scatter: float) -> bool:
    """Return whether a line rises too far for a linear fit, and its lags scatter less than a part of that."""
    steep = abs(line.rise) > LEAST_RISE and abs(line.rate) < _STEEPEST
    return steep and line.scatter < scatter * abs(line.rise)


def drift_findings(lines: Mapping[str, LagLine]) -> list[Finding]:
    """Return the drifts that lines show where the rig misfits, those that a sensor has alone in amber."""
    return [_drift(n, line, lines) for n, line in lines.items() if _rises(line, _STRAIGHT)]


def _drift(name: str, line: LagLine, lines: Mapping[str, LagLine]) -> Finding:
    """Return the finding of one line; its doubt holds what the machine does to the other sensors."""
    others = [other.rate for n, other in lines.items() if (n in JOINT) != (name in JOINT)]
    duration = abs(line.rise / line.rate)
    of_line = line.scatter / duration * math.sqrt(12.0 * BLOCK / duration)
    doubt = float(np.hypot(of_line, max(map(abs, others), default=abs(line.rate))))
    alone = abs(line.rate) > SURE * doubt
    light: Light = "amber" if alone else "green"
    beside = "seen beside a misfit of the rig" + ("" if alone else ", for which a cause may stand in for it")
    return drift_finding(light, name, Number(line.rate, doubt), duration, beside)


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
