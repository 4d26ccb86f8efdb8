"""The spring chassis between the two flanks of the gear's play: free motion, contact, inelastic impact.

Angles are relative to the distal side. Over a step the gear goes along the cubic through its angles and
speeds at both ends. The chassis y, with the inertia j, the spring k and its damper b,

    j y'' + b y' + k y = C,   |d - y| <= half the gap,   C pushes only, at a flank

rides on a flank as long as that pushes, moves freely and exactly otherwise, and takes the gear's speed when
it meets a flank. Play behind the chassis has a seat without inertia or memory: spring and damper act beyond
the gap and only push, as most simulators have it.
"""

import math
from typing import NamedTuple

from rsea_ros.compiler import njit


class SprungChassis(NamedTuple):
    """Stiffness k (N m/rad) and damping b (N m s/rad) of the spring, inertia j (kg m^2)."""

    k: float
    b: float
    j: float


class GearPath(NamedTuple):
    """Angle (rad) and speed (rad/s) of the gear at the beginning and at the end of a step of h seconds."""

    d_0: float
    w_0: float
    d_1: float
    w_1: float
    h: float


@njit(cache=True, inline="always")
def swing(y, v, t, chassis):  # type: ignore[no-untyped-def]
    """Return y and v after a time t of free motion: exact, under- and overdamped."""
    k, b, j = chassis
    decay = 0.5 * b / j
    square = k / j - decay * decay
    turn = math.sqrt(abs(square))
    if square > 0.0:
        e = math.exp(-decay * t)
        c, n = e * math.cos(turn * t), e * math.sin(turn * t) / turn
    else:
        slow, fast = math.exp(-(k / j) / (decay + turn) * t), math.exp(-(decay + turn) * t)
        c, n = 0.5 * (slow + fast), t * slow if turn * t < 1e-6 else 0.5 * (slow - fast) / turn
    return y * (c + decay * n) + v * n, v * (c - decay * n) - y * (k / j) * n


@njit(cache=True, inline="always")
def along(path, t):  # type: ignore[no-untyped-def]
    """Return angle, speed and integral of the angle of the gear at a time t of the step."""
    d_0, w_0, d_1, w_1, h = path
    mean = (d_1 - d_0) / h
    square, cube = (3.0 * mean - 2.0 * w_0 - w_1) / h, (w_0 + w_1 - 2.0 * mean) / (h * h)
    angle = d_0 + t * (w_0 + t * (square + t * cube))
    speed = w_0 + t * (2.0 * square + t * 3.0 * cube)
    return angle, speed, t * (d_0 + t * (w_0 / 2.0 + t * (square / 3.0 + t * cube / 4.0)))


@njit(cache=True, inline="always")
def release(side, half, path, chassis):  # type: ignore[no-untyped-def]
    """Return when in the step the flank stops pushing: 0 without contact, h when it pushes throughout."""
    if side == 0.0:
        return 0.0
    d_0, w_0, d_1, w_1, h = path
    k, b, j = chassis
    inertia = j * (w_1 - w_0) / h
    c_0 = side * (inertia + b * w_0 + k * (d_0 - side * half))
    c_1 = side * (inertia + b * w_1 + k * (d_1 - side * half))
    if c_1 >= 0.0:
        return h
    return h * c_0 / (c_0 - c_1) if c_0 > 0.0 else 0.0


@njit(cache=True, inline="always")
def impact(side, half, y, v, start, path, chassis):  # type: ignore[no-untyped-def]
    """Return when a chassis free since `start` meets the flank that it is behind at h, by regula falsi."""
    low, high = start, path.h
    angle, _, _ = along(path, start)
    f_low = side * (angle - y) - half
    end, _ = swing(y, v, path.h - start, chassis)
    f_high, t = side * (path.d_1 - end) - half, start
    for _ in range(12):
        if f_low >= 0.0:
            return low
        t = low + (high - low) * f_low / (f_low - f_high)
        angle, _, _ = along(path, t)
        at, _ = swing(y, v, t - start, chassis)
        f = side * (angle - at) - half
        if abs(f) < 1e-12:
            break
        if f > 0.0:
            high, f_high, f_low = t, f, 0.5 * f_low
        else:
            low, f_low, f_high = t, f, 0.5 * f_high
    return t


@njit(cache=True, inline="always")
def over_step(y_0, v_0, side, half, path, chassis):  # type: ignore[no-untyped-def]
    """Return y, v, the flank (-1, 0, 1) at the end of a step, and the integral of y over it."""
    d_1, w_1, h = path.d_1, path.w_1, path.h
    k, b, j = chassis
    leaves = release(side, half, path, chassis)
    _, _, whole = along(path, h)
    if leaves == h:
        return d_1 - side * half, w_1, side, whole - side * half * h
    area, y, v = 0.0, y_0, v_0
    if leaves > 0.0:
        angle, v, area = along(path, leaves)
        y, area = angle - side * half, area - side * half * leaves
    end, speed = swing(y, v, h - leaves, chassis)
    if abs(d_1 - end) <= half:
        return end, speed, 0.0, area - (j * (speed - v) + b * (end - y)) / k
    side = math.copysign(1.0, d_1 - end)
    meets = impact(side, half, y, v, leaves, path, chassis)
    end, speed = swing(y, v, meets - leaves, chassis)
    area -= (j * (speed - v) + b * (end - y)) / k
    _, _, before = along(path, meets)
    return d_1 - side * half, w_1, side, area + whole - before - side * half * (h - meets)


@njit(cache=True, inline="always")
def seat_torque(half, path, chassis):  # type: ignore[no-untyped-def]
    """Return the torque of a spring with a seat, N m: the mean over the step, and at its end."""
    d_0, _, d_1, _, h = path
    k, b, _ = chassis
    mean = at_end = 0.0
    for side in (-1.0, 1.0):
        e_0, e_1 = side * d_0 - half, side * d_1 - half
        if e_0 <= 0.0 and e_1 <= 0.0:
            continue
        meets = h * e_0 / (e_0 - e_1)
        for _ in range(3 if e_0 * e_1 < 0.0 else 0):
            angle, speed, _ = along(path, meets)
            meets = min(max(meets + (half - side * angle) / (side * speed + 1e-300), 0.0), h)
        start, end = meets if e_0 < 0.0 else 0.0, meets if e_1 < 0.0 else h
        angle_0, speed_0, area_0 = along(path, start)
        angle_1, speed_1, area_1 = along(path, end)
        push_0 = k * (side * angle_0 - half) + b * side * speed_0
        push_1 = k * (side * angle_1 - half) + b * side * speed_1
        if push_0 <= 0.0 and push_1 <= 0.0:
            continue
        if push_1 < 0.0:
            end = start + (end - start) * push_0 / (push_0 - push_1)
            angle_1, _, area_1 = along(path, end)
        elif push_0 < 0.0:
            start += (end - start) * push_0 / (push_0 - push_1)
            angle_0, _, area_0 = along(path, start)
        pushed = k * (area_1 - area_0 - side * half * (end - start)) + b * (angle_1 - angle_0)
        mean += pushed / h
        if e_1 > 0.0:
            at_end += side * max(push_1, 0.0)
    return mean, at_end
