"""Every effect a second time: its equations of motion as one would write them down, solved by scipy.

Nothing of `rsea_ros.model` or of the effects' functions is used. Each law gets (t, x, u, p), with
x = (angle, speed, …) and the command u held, and returns (x', torque that the F/T sensor sees).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

J_M, J_SC, B_M, K_S, B_S, RATIO = 0.953, 0.0040, 23.088, 1530.456, 3.0, 502.0
CREEP, CONTACT, DURATION = 2e-3, 1e7, 1.5
J = J_M + J_SC

Law = Callable[[float, np.ndarray, float, Mapping[str, float]], tuple[list[float], float]]


def sign(w: float) -> float:
    """Return the sign, with the creep that the project's friction has at rest."""
    return math.tanh(w / CREEP)


def motion(x, u, friction=0.0, spring=0.0):
    """Return (angle', speed', torque in the spring) of the rotor and chassis as one body."""
    torque = K_S * x[0] + B_S * x[1] + spring
    return x[1], (u - B_M * x[1] - friction - torque) / J, torque


def plain(change):
    """Return a law from a function that gives (command, friction, spring torque) of the effect."""

    def law(t, x, u, p):
        w, a, torque = motion(x, *change(t, x, u, p))
        return [w, a], torque

    return law


def sensor(change):
    """Return a law from a function that gives the sensor's torque from (torque, t, p)."""

    def law(t, x, u, p):
        w, a, torque = motion(x, u)
        return [w, a], change(torque, t, p)

    return law


def stribeck(t, x, u, p):
    extra = p["stribeck_torque"] * math.exp(-((x[1] / p["stribeck_velocity"]) ** 2))
    return u, (p["coulomb_torque"] + extra) * sign(x[1]), 0.0


def load_dependent(t, x, u, p):
    return u, p["coefficient"] * abs(K_S * x[0] + B_S * x[1]) * sign(x[1]), 0.0


def ripple(t, x, u, p):
    angle = p["cycles_per_revolution"] * RATIO * x[0] + p["phase"]
    return u, -p["amplitude"] * math.sin(angle), 0.0


def stop(t, x, u, p):
    return u, 0.0, p["stiffness"] * math.copysign(max(abs(x[0]) - p["angle"], 0.0), x[0])


def hysteresis(t, x, u, p):
    w, a, torque = motion(x[:2], u, spring=p["torque"] * x[2])
    return [w, a, (w - x[2] * abs(w)) / p["angle"]], torque


def current_lag(t, x, u, p):
    w, a, torque = motion(x[:2], x[2])
    return [w, a, (u - x[2]) / p["time_constant"]], torque


def sensor_lag(t, x, u, p):
    w, a, torque = motion(x[:2], u)
    return [w, a, (torque - x[2]) / p["time_constant"]], x[2]


def resonance(t, x, u, p):
    w, a, torque = motion(x[:2], u)
    turn = 2 * math.pi * p["frequency"]
    shake = torque - 2 * p["damping_ratio"] * turn * x[3] - turn**2 * x[2]
    return [w, a, x[3], shake], torque - p["participation"] * shake


def base(t, x, u, p):
    q, w, y, v = x
    torque = K_S * (q - y) + B_S * (w - v)
    damping = 2 * p["damping_ratio"] * math.sqrt(p["stiffness"] * p["inertia"])
    pull = (torque - damping * v - p["stiffness"] * y) / p["inertia"]
    return [w, (u - B_M * w - torque) / J, v, pull], torque


def gear(t, x, u, p):
    chassis, v, rotor, w = x
    through = p["stiffness"] * (rotor - chassis)
    torque = K_S * chassis + B_S * v
    return [v, (through - torque) / J_SC, w, (u - B_M * w - through) / J_M], torque


def backlash(t, x, u, p):
    rotor, w, chassis, v = x
    depth = max(abs(rotor - chassis) - p["gap"] / 2, 0.0)
    flank = math.copysign(1.0, rotor - chassis)
    push = CONTACT * depth + 2 * math.sqrt(CONTACT * J_SC) * (w - v) * flank if depth > 0.0 else 0.0
    contact, torque = flank * max(push, 0.0), K_S * chassis + B_S * v
    return [w, (u - B_M * w - contact) / J_M, v, (contact - torque) / J_SC], torque


LAWS: dict[str, tuple[int, Law]] = {
    "asymmetric_friction": (
        2, plain(lambda t, x, u, p: (u, p["offset"] + p["viscous_difference"] * abs(x[1]) / 2, 0.0))),
    "backlash": (4, backlash),
    "base_compliance": (4, base),
    "command_delay": (2, plain(lambda t, x, u, p: (u, 0.0, 0.0))),
    "coulomb_friction": (2, plain(lambda t, x, u, p: (u, p["torque"] * sign(x[1]), 0.0))),
    "current_loop_lag": (3, current_lag),
    "damping_drift": (
        2, plain(lambda t, x, u, p: (u, B_M * p["relative_change"] * t / DURATION * x[1], 0.0))),
    "ft_bias": (2, sensor(lambda torque, t, p: torque + p["bias"])),
    "ft_drift": (2, sensor(lambda torque, t, p: torque + p["drift"] * t / DURATION)),
    "ft_gain_error": (2, sensor(lambda torque, t, p: torque * p["gain"])),
    "ft_sensor_lag": (3, sensor_lag),
    "gear_compliance": (4, gear),
    "hard_stop": (2, plain(stop)),
    "load_dependent_friction": (2, plain(load_dependent)),
    "mains_interference": (
        2, sensor(lambda torque, t, p: torque
                  + p["amplitude"] * math.sin(2 * math.pi * p["frequency"] * t + p["phase"]))),
    "nonlinear_spring": (2, plain(lambda t, x, u, p: (u, 0.0, K_S * p["cubic"] * x[0] ** 3))),
    "spring_hysteresis": (3, hysteresis),
    "stiffness_drift": (
        2, plain(lambda t, x, u, p: (u, 0.0, K_S * p["relative_change"] * t / DURATION * x[0]))),
    "stribeck_friction": (2, plain(stribeck)),
    "structural_resonance": (4, resonance),
    "torque_constant_error": (2, plain(lambda t, x, u, p: (p["gain"] * u, 0.0, 0.0))),
    "torque_ripple": (2, plain(ripple)),
    "torque_saturation": (
        2, plain(lambda t, x, u, p: (math.copysign(min(abs(u), p["limit"]), u), 0.0, 0.0))),
}  # fmt: skip
"""For each effect how many states its equations have, and the equations."""


def solve(name: str, p: Mapping[str, float], held: np.ndarray, period: float) -> dict[str, np.ndarray]:
    """Return ft, position and velocity at the end of each hold, from rest."""
    states, law = LAWS[name]
    ends, delay = period * np.arange(1, len(held) + 1), p.get("delay", 0.0)
    switches = np.concatenate([[0.0, delay], ends + delay, ends])
    times, x, rows = np.unique(switches[switches <= ends[-1]]), np.zeros(states), []
    for begin, end in pairwise(times):
        hold = math.floor(((begin + end) / 2 - delay) / period)
        u = held[hold] if hold >= 0 else 0.0
        x = solve_ivp(lambda t, x, u=u: law(t, x, u, p)[0], (begin, end), x, method="LSODA",
                      rtol=1e-8, atol=1e-11).y[:, -1]  # fmt: skip
        rows.append((law(end, x, u, p)[1], x[0], x[1]))
    kept = np.array(rows)[np.isin(times[1:], ends)]
    return dict(zip(("ft", "position", "velocity"), kept.T, strict=True))
