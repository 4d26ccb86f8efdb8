"""A torque that follows the position of a machine whose rig has nothing to hold it: a spring, a pendulum.

The torque that acted, by least squares along the measured motion, without and with the restoring terms:

    T = J q'' + b q' + c sign(q') + T_0 (+ K q + G sin(q - q_0))
"""

from __future__ import annotations

import numpy as np

from rsea_ros.checks.finding import Finding
from rsea_ros.checks.gain_findings import RIGHT_RIG
from rsea_ros.errors import RseaError
from rsea_ros.model.inverse import Motion, motion_from
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

_FALLS = 0.55
"""Of what is left of the torque: with a spring or pendulum that is there, less is left."""
_EDGE = 0.02
"""Of the record at either end, where the filter settles."""
_SHARP = 0.05
"""Of the speed's RMS: the width of its sign's step."""


def restoring_findings(record: Record, rig: Rig) -> list[Finding]:
    """Return the finding of a torque that follows the position, for a rig that has neither K nor gravity."""
    if rig["spring_end.stiffness"] or rig["spring_end.gravity"]:
        return []
    try:
        motion = motion_from(record)
    except (RseaError, ValueError):
        return []
    without, held = residual_shares(motion)
    if not held < _FALLS * without:
        return []
    return [
        Finding(
            "red",
            "wrong_rig",
            "spring_end.stiffness",
            100.0 * (1.0 - (held / without) ** 2),
            "%",
            expected="0",
            detail="of the torque that the rig leaves open follows the position: a spring or a pendulum",
            remedy=RIGHT_RIG,
        )
    ]


def residual_shares(motion: Motion) -> tuple[float, float]:
    """Return the share of the torque's RMS that is left without and with the restoring terms."""
    sign = np.tanh(motion.v / max(_SHARP * float(np.std(motion.v)), 1e-300))
    holding = [motion.q, np.sin(motion.q), np.cos(motion.q)]
    moving = [motion.a, motion.v, sign, np.ones_like(motion.v)]
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    without, held = ([c[known] for c in columns] for columns in (moving, [*moving, *holding]))
    return _rms_left(without, motion.torque[known]), _rms_left(held, motion.torque[known])


def _rms_left(columns: list[FloatArray], torque: FloatArray) -> float:
    edge = int(_EDGE * len(torque))
    inside = slice(edge, len(torque) - edge)
    rows = np.column_stack(columns)[inside]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    y = torque[inside]
    return float(np.std(y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]) / max(float(np.std(y)), 1e-300))
