"""Two arms in plain Python, by Runge and Kutta's method: one behind a spring, one on a rigid drive.

They share no code with the package. A run is (t, command, stamps, channels with noise).
"""

import math

import numpy as np

RATE, FINER, CREEP = 200, 8, 1e-3
"""Hz; steps in a sample; rad/s, below which friction creeps."""
NOISE = {"position": 2e-5, "velocity": 2e-3, "motor_torque": 5e-3, "ft": 5e-3}
SPRING = {"j": 0.05, "b": 0.2, "k": 100.0, "b_s": 0.05, "j_l": 0.1, "b_l": 0.05}
"""The arm behind a spring, SI: rotor and gear, spring, load."""
ROTOR, DAMPING, HELD = 1e-3, 0.3, 0.6
"""Of the rigid drive: kg m^2 beside the load's inertia; N m s/rad; rad, about which gravity loads it."""


def behind_spring(seed, *, constant=1.0, sensor=1.0, friction=0.0, duration=8.0, **other):
    """Drive the arm with a sweep and noise.

    constant: true torque constant over the stated one. sensor: gain of the F/T sensor. friction: N m.
    """
    p = SPRING | other
    t, rng = np.arange(int(duration * RATE)) / RATE, np.random.default_rng(seed)
    rise = math.log(15.0 / 0.3) / duration
    sweep = np.sin(2.0 * math.pi * 0.3 / rise * np.expm1(rise * t))
    command = 2.0 * sweep + 0.2 * rng.standard_normal(len(t))

    def rates(x, u):
        q, v, a, w = x
        torque = p["k"] * (q - a) + p["b_s"] * (v - w)
        loss = friction * math.tanh(v / (8.0 * CREEP)) + p["b"] * v
        return v, (constant * u - loss - torque) / p["j"], w, (torque - p["b_l"] * w) / p["j_l"]

    q, v, a, w = _run(rates, (0.0, 0.0, 0.0, 0.0), command).T
    torque = sensor * (p["k"] * (q - a) + p["b_s"] * (v - w))
    return _measured({"position": q, "velocity": v, "motor_torque": command, "ft": torque}, t, command, rng)


def rigid(seed, *, j_l=0.099, gravity=2.0, friction=0.0, load=0.0, offset=0.0, size=0.15, duration=10.0):
    """Move an arm a little about an angle at which gravity loads its gear.

    gravity: largest torque, N m. friction, offset: N m. load: friction over the torque that the gear carries.
    """
    t, rng = np.arange(int(duration * RATE)) / RATE, np.random.default_rng(seed)
    lines = np.arange(0.3, 3.0, 0.4)
    waves = np.sin(2.0 * math.pi * lines * t[:, None] + rng.uniform(0.0, 2.0 * math.pi, len(lines)))
    command = gravity * math.sin(HELD) + offset + size * waves.sum(axis=1) / math.sqrt(0.5 * len(lines))

    def rates(x, u):
        q, v = x
        weight, sign = gravity * math.sin(q), math.tanh(v / CREEP)
        rest = u - friction * sign - offset - DAMPING * v - weight
        for side in (1.0, -1.0):  # of the torque in the gear, which has the sign that it makes
            loss = load * side * sign
            a = (rest - loss * weight) / (j_l + ROTOR + loss * j_l)
            if side * (weight + j_l * a) >= 0.0:
                break
        return v, a

    q, v = _run(rates, (HELD, 0.0), command).T
    return _measured({"position": q, "velocity": v, "motor_torque": command}, t, command, rng, torque=0.04)


def _run(rates, x, command):
    """Return the state at the end of each held command, shape (n, states)."""
    h, out = 1.0 / RATE / FINER, []
    for u in command.tolist():
        for _ in range(FINER):
            a = rates(x, u)
            b = rates([s + 0.5 * h * r for s, r in zip(x, a, strict=True)], u)
            c = rates([s + 0.5 * h * r for s, r in zip(x, b, strict=True)], u)
            d = rates([s + h * r for s, r in zip(x, c, strict=True)], u)
            slopes = zip(a, b, c, d, strict=True)
            x = [s + h / 6.0 * (i + 2.0 * j + 2.0 * k + m) for s, (i, j, k, m) in zip(x, slopes, strict=True)]
        out.append(x)
    return np.array(out)


def _measured(true, t, command, rng, torque=NOISE["motor_torque"]):
    noise = NOISE | {"motor_torque": torque}
    channels = {n: y + noise[n] * rng.standard_normal(len(t)) for n, y in true.items()}
    return t, command, t + 1.0 / RATE, channels
