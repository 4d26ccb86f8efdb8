"""The measurements that the rig predicts for a record, beside the actual ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.checks.channel_spectra import Quotient, quotient
from rsea_ros.errors import RseaError
from rsea_ros.model.inverse import inverse_torque, is_inverse, motion_from
from rsea_ros.model.pace import is_too_fast
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import FloatArray, Record

MOST_STEPS = 40.0
"""Times as many periods as samples in the command: a record of gaps, which no simulation should fill."""


@dataclass(frozen=True)
class Side:
    """One channel at its stamps t (s): measured y and predicted p, both shape (n,), in the channel's unit."""

    t: FloatArray
    y: FloatArray
    p: FloatArray


def sides(record: Record, rig: Rig) -> Mapping[str, Side]:
    """Return measured beside predicted by channel; empty where nothing can be simulated.

    record: with finite values and rising stamps. A rig without a spring has one side, the torque that the
    measured motion takes (model/inverse.py).
    """
    if "command" not in record or len(record["command"]) < 64:
        return {}
    if is_full_of_gaps(record) or is_too_fast(record):
        return {}
    try:
        with np.errstate(all="ignore"):
            return _inverse(record, rig) if is_inverse(rig) else _forward(record, rig)
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return {}


def _forward(record: Record, rig: Rig) -> Mapping[str, Side]:
    predicted = {n: p for n, p in simulate(rig, record).items() if np.isfinite(p).all()}
    return {n: Side(record[n].t, record[n].y, p) for n, p in predicted.items()}


def _inverse(record: Record, rig: Rig) -> Mapping[str, Side]:
    if "position" not in record:
        return {}
    motion = motion_from(record)
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    return {"motor_torque": Side(motion.t[known], motion.torque[known], inverse_torque(rig, motion)[known])}


def is_full_of_gaps(record: Record) -> bool:
    """Return whether the record lasts much longer than its samples do: a clock that was set."""
    t = record["command"].t
    period = float(np.median(np.diff(t)))
    return not period > 0.0 or record.stop - record.start > MOST_STEPS * period * len(t)


def quotients(compared: Mapping[str, Side]) -> dict[str, Quotient]:
    """Return the quotient of every channel that has one."""
    by_channel = {n: quotient(n, s.t, s.y, s.p) for n, s in compared.items()}
    return {n: q for n, q in by_channel.items() if q is not None}
