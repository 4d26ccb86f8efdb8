"""Travel, stiffness and limit from slow ramps of torque against a locked output, without a dynamic model.

The torque is the measured motor torque where present, so friction of motor and gear is in all three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_fields import END_NAMES
from rsea_ros.records.record import FloatArray, Record

SLOW = 1.0
"""Hz. RMS frequency of a command up to which inertia and damping count for nothing."""
AT_END = 0.975
"""Of the largest command: from here on a ramp is at its end."""
LOADED = (0.5, 0.95)
"""Of the largest torque: where the stiffness is read off, clear of backlash and of the turning points."""
UNLOADED = 0.05
SATURATED = 0.9
"""Of the command at its ends: motor torque below this is at a limit."""


@dataclass(frozen=True)
class Statics:
    """Torque against angle of a locked output.

    torque: N m, the ramps go from -torque to +torque. travel: rad, between those ends. stiffness: N m/rad,
    slope of the flanks while the load grows. lost_motion: rad, between the two directions at zero torque.
    limit: N m, at which the motor torque stops following the command; None where it follows to the end.
    """

    torque: float
    travel: float
    stiffness: float
    lost_motion: float
    limit: float | None


def statics_of(record: Record, rig: Rig) -> Statics | None:
    """Return the statics of a record of slow ramps on a rig with both ends clamped, None for any other,
    and where the angle does not grow with the load."""
    held = rig.clamped.issuperset(END_NAMES) and not rig.rigid_spring
    if not held or "position" not in record or _rms_frequency(record) > SLOW:
        return None
    t, angle = record["position"].t, record["position"].y
    command = np.interp(t, record["command"].t, record["command"].y)
    end = float(min(command.max(), -command.min()))
    if end <= 0.0:
        return None
    acting = record["motor_torque" if "motor_torque" in record else "command"]
    torque = np.interp(t, acting.t, acting.y)
    forward, backward = command >= AT_END * end, command <= -AT_END * end
    reached = float(np.median(np.abs(torque[forward | backward])))
    stiffness = _stiffness(command, torque, angle)
    if not np.isfinite(stiffness) or not (forward.any() and backward.any()):
        return None
    return Statics(
        torque=end,
        travel=float(np.median(angle[forward]) - np.median(angle[backward])),
        stiffness=stiffness,
        lost_motion=_lost_motion(command, angle, end),
        limit=reached if reached < SATURATED * end else None,
    )


def _rms_frequency(record: Record) -> float:
    """Return the RMS frequency of the command, Hz: its rate over itself."""
    t, y = record["command"].t, record["command"].y
    rate = np.diff(y) / np.diff(t)
    deviation = float(np.std(y))
    return float(np.sqrt(np.mean(rate**2))) / (2.0 * np.pi * deviation) if deviation > 0.0 else np.inf


def _stiffness(command: FloatArray, torque: FloatArray, angle: FloatArray) -> float:
    """Return torque per angle while the load grows, one line for each direction, N m/rad."""
    peak = float(np.quantile(np.abs(torque), 0.99))
    growing = (np.gradient(np.abs(command)) > 0.0) & (np.abs(command) < peak)
    size, bend = 0.0, 0.0
    for sign in (1.0, -1.0):
        flank = growing & (sign * torque > LOADED[0] * peak) & (sign * torque < LOADED[1] * peak)
        if flank.any():
            load = torque[flank] - torque[flank].mean()
            size, bend = size + float(load @ load), bend + float(load @ angle[flank])
    return size / bend if bend > 0.0 else np.inf


def _lost_motion(command: FloatArray, angle: FloatArray, end: float) -> float:
    """Return the angle between falling and rising command at zero torque, rad; nan where one is missing."""
    rising, unloaded = np.gradient(command) > 0.0, np.abs(command) < UNLOADED * end
    down, up = angle[unloaded & ~rising], angle[unloaded & rising]
    return float(np.median(down) - np.median(up)) if len(down) and len(up) else float("nan")
