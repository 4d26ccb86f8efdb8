"""The start of the fit of a joint in a position loop, by a regression of torques along its measured motion.

    u = J a + b v + F sign(v) + c_s sin q + c_c cos q + T_0,   m g l = |(c_s, c_c)|, its angle atan2(c_c, c_s)

u is the loop's law on the measured motion (its integral aside), q filtered both ways and differentiated (the
inverse model; Gautier, Janot et al.). Gravity's angle has two minima in an output error: this finds the side.
"""

from __future__ import annotations

import math

import numpy as np

from rsea_ros.errors import RseaError
from rsea_ros.model.inverse import FEWEST, smooth
from rsea_ros.model.position_loop import loop_parameters
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

_SLOW = 0.05
"""Of the RMS speed: below it the sign of the speed is not determined."""
_TURNS = 2.0
"""rad of travel from which gravity is distinguished from a constant torque."""
_LEAST = 1e-3
"""Of its stated value: an inertia or damping that comes out smaller begins there."""
GRAVITY, ANGLE = "spring_end.gravity", "spring_end.gravity_angle"
INERTIA, DAMPING = "rotor.reflected_inertia", "rotor.reflected_damping"


def joint_start(record: Record, rig: Rig) -> Rig:
    """Return the rig with its free values from the regression; unchanged where that is impossible.

    record: with the targets as its command.
    """
    try:
        inertia, damping, _, sine, cosine, _ = _regression(record, rig)
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return rig
    load = rig["spring_end.inertia"] + rig["chassis.inertia"]
    coefficients = {
        INERTIA: max(inertia - load, _LEAST * rig[INERTIA]),
        DAMPING: max(damping, _LEAST * rig[DAMPING]),
        GRAVITY: math.hypot(sine, cosine),
        ANGLE: math.atan2(cosine, sine),
    }
    free = rig.free()
    if GRAVITY in free and ANGLE not in free:
        coefficients[GRAVITY] = max(sine, 0.0)
    return rig.with_values({n: v for n, v in coefficients.items() if n in free and math.isfinite(v)})


def _regression(record: Record, rig: Rig) -> FloatArray:
    """Return J, b, F, c_s, c_c, T_0. Raises ValueError for a record too short."""
    position = record["position"]
    if len(position) < FEWEST:
        raise ValueError("too few samples")
    step = 1.0 / position.rate
    t = np.arange(position.t[0], position.t[-1], step)
    q = smooth(np.interp(t, position.t, position.y), step)
    v = smooth(np.gradient(q, step), step)
    a = smooth(np.gradient(v, step), step)
    sign = np.tanh(v / max(_SLOW * float(np.sqrt(np.mean(v**2))), 1e-300))
    terms = np.column_stack([a, v, sign, np.sin(q), np.cos(q), np.ones(len(q))])
    keep = terms if np.ptp(q) > _TURNS else terms[:, :5]
    solved = np.linalg.lstsq(keep, _loop_torque(record, rig, t, q, v), rcond=None)[0]
    return np.concatenate([solved, np.zeros(6 - len(solved))])


def _loop_torque(record: Record, rig: Rig, t: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """Return the torque that the loop makes along a motion, without its integral."""
    command = record["command"]
    held = command.y[np.clip(np.searchsorted(command.t, t, side="right") - 1, 0, len(command) - 1)]
    target = smooth(held, float(t[1] - t[0]))
    _, position, _, velocity, *_ = loop_parameters(rig)
    if rig.loop == "pd":
        return position * (target - q) - velocity * v
    return velocity * (position * (target - q) - v)
