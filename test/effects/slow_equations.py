"""A second implementation of every effect: its equations of motion as written on paper, solved by scipy.

It uses nothing of `rsea_ros.model` and none of the effects' functions. Each law gets (t, x, u, p), with
x = (angle, speed, …) and the command u held, and returns (x', torque that the F/T sensor sees), and the angle
and speed that the encoder reads where they are not the first two of x.
"""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

J_M, J_SC, B_M, K_S, B_S, RATIO = 0.953, 0.0040, 23.088, 1530.456, 3.0, 502.0
CREEP, CONTACT, DURATION = 2e-3, 1e7, 0.5
J = J_M + J_SC

Law = Callable[[float, np.ndarray, float, Mapping[str, float]], Any]


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


def viscoelastic(t, x, u, p):
    w, a, torque = motion(x[:2], u, spring=p["share"] * K_S * x[2])
    return [w, a, w - x[2] / p["time_constant"]], torque


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


def lugre(t, x, u, p):
    level = p["coulomb_torque"] + p["stribeck_torque"] * math.exp(-((x[1] / p["stribeck_velocity"]) ** 2))
    slip = x[1] - p["bristle_stiffness"] * abs(x[1]) * x[2] / level
    w, a, torque = motion(x[:2], u, p["bristle_stiffness"] * x[2] + p["bristle_damping"] * slip)
    return [w, a, slip], torque


def overshoot(t, x, u, p):
    log, tau = math.log(p["overshoot"]), p["time_constant"]
    zeta = -log / math.hypot(math.pi, log)
    w, a, torque = motion(x[:2], x[2])
    return [w, a, x[3], (u - x[2]) / tau**2 - 2 * zeta * x[3] / tau], torque


def sag(t, x, u, p):
    share = x[1] / p["no_load_speed"]
    return min(max(u, -p["limit"] * (1 + share)), p["limit"] * (1 - share)), 0.0, 0.0


def directional(t, x, u, p):
    load = K_S * x[0] + B_S * x[1]
    size = abs(p["motor_coefficient"] * u + p["load_coefficient"] * load)
    size += p["quadratic"] * min(abs(u), abs(load)) ** 2 * (u * load > 0)
    return u, size * sign(x[1]), 0.0


def gear_loss(t, x, u, p):
    size = p["mean"] * abs(u) * x[2] + p["difference"] * u * x[2] ** 2
    w, a, torque = motion(x[:2], u, size)
    return [w, a, (w - abs(w) * x[2]) / p["angle"]], torque


def eccentricity(t, x, u, p):
    w, a, torque = motion(x, u)
    wave = p["cycles_per_revolution"] * RATIO
    error, slope = (p["amplitude"] * f(wave * x[0] + p["phase"]) for f in (math.sin, math.cos))
    return [w, a], torque, x[0] + error, x[1] + wave * slope * x[1]


LAWS: dict[str, tuple[int, Law]] = {
    "asymmetric_friction": (
        2, plain(lambda t, x, u, p: (u, p["offset"] + p["viscous_difference"] * abs(x[1]) / 2, 0.0))),
    "backlash": (4, backlash),
    "base_compliance": (4, base),
    "command_delay": (2, plain(lambda t, x, u, p: (u, 0.0, 0.0))),
    "coulomb_friction": (2, plain(lambda t, x, u, p: (u, p["torque"] * sign(x[1]), 0.0))),
    "current_loop_lag": (3, current_lag),
    "current_loop_overshoot": (4, overshoot),
    "damping_drift": (
        2, plain(lambda t, x, u, p: (u, B_M * p["relative_change"] * t / DURATION * x[1], 0.0))),
    "dead_zone": (2, plain(lambda t, x, u, p: (math.copysign(max(abs(u) - p["width"], 0.0), u), 0.0, 0.0))),
    "directional_load_friction": (2, plain(directional)),
    "encoder_eccentricity": (2, eccentricity),
    "ft_bias": (2, sensor(lambda torque, t, p: torque + p["bias"])),
    "ft_drift": (2, sensor(lambda torque, t, p: torque + p["drift"] * t / DURATION)),
    "ft_gain_error": (2, sensor(lambda torque, t, p: torque * p["gain"])),
    "ft_sensor_lag": (3, sensor_lag),
    "gear_compliance": (4, gear),
    "gear_loss": (3, gear_loss),
    "hard_stop": (2, plain(stop)),
    "load_dependent_friction": (2, plain(load_dependent)),
    "lopsided_spring": (2, plain(lambda t, x, u, p: (u, 0.0, K_S * p["quadratic"] * x[0] ** 2))),
    "lugre_friction": (3, lugre),
    "mains_interference": (
        2, sensor(lambda torque, t, p: torque
                  + p["amplitude"] * math.sin(2 * math.pi * p["frequency"] * t + p["phase"]))),
    "nonlinear_spring": (2, plain(lambda t, x, u, p: (u, 0.0, K_S * p["cubic"] * x[0] ** 3))),
    "quadratic_drag": (2, plain(lambda t, x, u, p: (u, p["coefficient"] * x[1] * abs(x[1]), 0.0))),
    "spring_hysteresis": (3, hysteresis),
    "stiffness_drift": (
        2, plain(lambda t, x, u, p: (u, 0.0, K_S * p["relative_change"] * t / DURATION * x[0]))),
    "stribeck_friction": (2, plain(stribeck)),
    "structural_resonance": (4, resonance),
    "torque_constant_drift": (
        2, plain(lambda t, x, u, p: ((1 + p["relative_change"] * t / DURATION) * u, 0.0, 0.0))),
    "torque_constant_error": (2, plain(lambda t, x, u, p: (p["gain"] * u, 0.0, 0.0))),
    "torque_ripple": (2, plain(ripple)),
    "torque_saturation": (2, plain(lambda t, x, u, p: (math.copysign(min(abs(u), p["limit"]), u), 0.0, 0.0))),
    "viscoelastic_spring": (3, viscoelastic),
    "voltage_sag": (2, plain(sag)),
}  # fmt: skip
"""For each effect how many states its equations have, and the equations."""
LATE = {"ft_delay": ("ft",), "encoder_delay": ("position", "velocity")}
"""Channels read late, of a bench that is linear: there they are those of a command that is as late."""


def solve(name: str, p: Mapping[str, float], held: np.ndarray, period: float) -> dict[str, np.ndarray]:
    """Return ft, position and velocity at the end of each hold, from rest."""
    if name in LATE:
        now, late = (solve("command_delay", {"delay": d}, held, period) for d in (0.0, p["delay"]))
        return now | {channel: late[channel] for channel in LATE[name]}
    states, law = LAWS[name]
    ends, delay = period * np.arange(1, len(held) + 1), p.get("delay", 0.0)
    switches = np.concatenate([[0.0, delay], ends + delay, ends])
    times, x, rows = np.unique(switches[switches <= ends[-1]]), np.zeros(states), []
    for begin, end in pairwise(times):
        hold = math.floor(((begin + end) / 2 - delay) / period)
        u = held[hold] if hold >= 0 else 0.0
        x = solve_ivp(lambda t, x, u=u: law(t, x, u, p)[0], (begin, end), x, method="LSODA",
                      rtol=1e-7, atol=1e-10).y[:, -1]  # fmt: skip
        torque, *read = law(end, x, u, p)[1:]
        rows.append((torque, *(read or x[:2])))
    kept = np.array(rows)[np.isin(times[1:], ends)]
    return dict(zip(("ft", "position", "velocity"), kept.T, strict=True))
