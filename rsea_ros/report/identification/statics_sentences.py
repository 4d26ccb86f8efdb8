"""Results of slow ramps against a locked output, as sentences."""

from __future__ import annotations

import math

from rsea_ros.identification.result import Statics
from rsea_ros.report import words


def statics_sentences(statics: Statics) -> tuple[str, ...]:
    """Return travel, stiffness, lost motion and limit, a sentence each."""
    end = words.number(statics.torque, 3)
    travel = (
        f"Between −{end} and +{end} N·m of command the output angle travels {_degrees(statics.travel)}"
        + (
            f", {_degrees(statics.lost_motion)} of it at no load."
            if math.isfinite(statics.lost_motion)
            else "."
        )
    )
    stiffness = f"Static stiffness while the load grows: {words.quantity(statics.stiffness, 'N m/rad')}."
    return travel, stiffness, _limit(statics)


def _limit(statics: Statics) -> str:
    if statics.limit is None:
        return "The motor torque follows the command to its ends: no saturation."
    reached, asked = words.number(statics.limit, 3), words.number(statics.torque, 3)
    return f"Saturation: the motor torque stops at {reached} N·m where {asked} N·m are commanded."


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.2f}°"
