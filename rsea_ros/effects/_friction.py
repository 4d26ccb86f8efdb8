"""Shared by the friction effects: the mean over a step of a friction torque, for steps of any length.

The law is F tanh(w / w_c), which is F sign(w) but for a creep below w_c (presliding). Over a step in
which w goes straight from w_0 to w_1 its mean is, exactly,

    F w_c (ln cosh(w_1 / w_c) - ln cosh(w_0 / w_c)) / (w_1 - w_0)

and w_1 depends on it: w_1 = w_free - mobility * mean. Newton's method, kept in a bracket, solves that, so
sticking does not make the problem stiff.
"""

import math
from collections.abc import Callable
from typing import Any

from rsea_ros.compiler import njit
from rsea_ros.effects.effect import AgainstMotion, Parameter, Parameters
from rsea_ros.effects.signal_table import CREEP, GEAR_VELOCITY, GEAR_VELOCITY_SPAN, MOBILITY


def friction_torque(name: str, typical: float) -> Parameter:
    """Return the parameter of a friction torque, N m."""
    reason = "friction above the largest torque would hold the machine still"
    return Parameter(name, "N m", null=0.0, low=0.0, high=50.0, typical=typical, reason=reason)


PRESLIDING = Parameter(
    "creep_velocity", "rad/s", null=2e-3, low=1e-5, high=2e-2, typical=2e-3, logarithmic=True, optional=True,
    ideal_at_low=True,
    reason="from 1/60000 of the largest speed, as good as rest, to 1/30, where friction is viscous",
)
"""Below it a gear with friction creeps instead of standing still; every friction effect has it."""

_SLIDES = 12.0  # in creep velocities: 1 - tanh(12) = 8e-11
_TURNS = 3.0  # in creep velocities: below it the motion may reverse, and its speed is not linear in time
_STRAIGHT = 0.3  # friction's own change of speed times the whole: below it the speed goes nearly straight
_PARTS = 4  # of a step in which it does not
_OF_WIDTH, _MOST_PARTS = 8, 16  # parts a width over which friction fades, of all that the speed can change by
_FADED = 4.0  # widths: exp(-16) = 1e-7
_SHRINKS = 0.9  # of Newton's last change: larger ones come from swinging about the knee of tanh


@njit(cache=True, error_model="numpy")
def mean_friction(s, size, last, presliding, more=0.0, fades=1.0):  # type: ignore[no-untyped-def]
    """Return the mean friction torque (N m, against motion when positive) of this step.

    size: friction torque at speed, N m. last: what this function returned at its last evaluation, which is
    already in the predicted end of the step. presliding: w_c, rad/s; s[CREEP] replaces it where that is set.
    more: what comes on top near rest, N m; it fades as exp(-(w / fades)^2), fades in rad/s.
    """
    creep = s[CREEP] if s[CREEP] > 0.0 else presliding
    start = (s[GEAR_VELOCITY] - 0.5 * s[GEAR_VELOCITY_SPAN]) / creep
    predicted = (s[GEAR_VELOCITY] + 0.5 * s[GEAR_VELOCITY_SPAN]) / creep
    mobility, width = s[MOBILITY] / creep, fades / creep
    turns = start * predicted <= 0.0 or min(abs(start), abs(predicted)) < _TURNS
    if more != 0.0 and not turns and min(abs(start), abs(predicted)) > _FADED * width:
        more = 0.0
    free, gain = predicted + mobility * last, mobility * (size + more)
    if more == 0.0 and start > _SLIDES and free - gain > _SLIDES:
        return size
    if more == 0.0 and start < -_SLIDES and free + gain < -_SLIDES:
        return -size
    parts = _PARTS if turns and gain * abs(predicted - start) >= _STRAIGHT else 1
    if more != 0.0:
        parts = max(parts, min(1 + int(_OF_WIDTH * (abs(free - start) + gain) / width), _MOST_PARTS))
    at, total = start, 0.0
    rise, mobility = (free - start) / parts, mobility / parts
    for _ in range(parts):
        torque = size
        if more != 0.0:
            middle = at + 0.5 * (rise - mobility * (size + more * _fade(at, width)) * math.tanh(at))
            torque += more * _fade(middle, width)
        mean = _implicit_mean(at, at + rise, mobility * torque)
        at += rise - mobility * torque * mean
        total += torque * mean
    return total / parts


@njit(cache=True, error_model="numpy", inline="always")
def _fade(w, width):  # type: ignore[no-untyped-def]
    return math.exp(-(w / width) * (w / width))


@njit(cache=True, error_model="numpy")
def _implicit_mean(start, free, gain):  # type: ignore[no-untyped-def]
    """Return the mean of tanh over the path from start to end = free - gain * mean.

    Where Newton's step leaves the bracket, or swings between both sides of the knee of tanh, rest comes next.
    """
    low, high, fade = free - abs(gain), free + abs(gain), math.exp(-2.0 * abs(start))
    end, last = free - gain * math.copysign((1.0 - fade) / (1.0 + fade), start), math.inf
    for _ in range(40):
        mean, slope = mean_tanh(start, end, fade)
        change = (end + gain * mean - free) / (1.0 + gain * slope)
        if abs(change) < 1e-3:
            break
        low, high = (low, end) if change > 0.0 else (end, high)
        if low < end - change < high and abs(change) < _SHRINKS * last:
            end, last = end - change, abs(change)
        else:
            end, last = 0.0 if low < 0.0 < high else 0.5 * (low + high), math.inf
    return mean - slope * change


@njit(cache=True, error_model="numpy")
def mean_tanh(a, b, fade):  # type: ignore[no-untyped-def]
    """Return the mean of tanh over the straight path from a to b, and its slope by b. fade: exp(-2 |a|).

    ln cosh x is |x| + ln(1 + exp(-2 |x|)) - ln 2, which no large x overflows.
    """
    path = b - a
    if abs(path) < 1e-3:
        mean = math.tanh(0.5 * (a + b))
        return mean, 0.5 * (1.0 - mean * mean)
    fade_b = math.exp(-2.0 * abs(b))
    mean = (abs(b) - abs(a) + math.log((1.0 + fade_b) / (1.0 + fade))) / path
    at_b = math.copysign((1.0 - fade_b) / (1.0 + fade_b), b)
    return mean, (at_b - mean) / path


def against(level: Any, creep: int) -> AgainstMotion:
    """Return the compensation of a friction law. level: its compiled `f(p, w)`; creep: place of w_c in p.

    The mean over a hold in which the speed goes straight from start to end, as the step has it.
    """
    size: Callable[[Parameters, float], float] = level.py_func

    def mean(p: Parameters, start: float, end: float) -> float:
        a, b = start / p[creep], end / p[creep]
        mean_sign: float = mean_tanh.py_func(a, b, math.exp(-2.0 * abs(a)))[0]
        return size(p, 0.5 * (start + end)) * mean_sign

    return AgainstMotion(mean)
