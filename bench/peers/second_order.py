"""The joint that physical peers fit: inertia, damping, spring, gravity, friction by BAM's laws, and a delay.

    J q'' = g u(t - delay) - b q' - k q - m sin(q) - friction,     y = q + bias, or T_s = k q + b_s q' + bias

Friction as BAM applies it: what stops the joint within the step, up to the law's limit (Rhoban/bam 1.0.2,
model.py and simulate.py). The law is implemented here from its equations: the package needs Python 3.12, and
its simulator is made for its own servos and logs. Semi-implicit Euler, PARTS steps a sample.
"""

import numpy as np
from numba import njit

PARTS = 4
NAMES = (
    "inertia", "damping", "stiffness", "gravity", "friction", "stribeck", "stribeck_velocity", "alpha",
    "load_motor", "load_external", "load_motor_stribeck", "load_external_stribeck", "quadratic_motor",
    "quadratic_external", "delay", "bias", "spring_damping",
)  # fmt: skip


@njit(cache=True)
def simulate_run(p, u, period, torque_output):
    """Return y, shape (n,), of a run from rest; p: values in the order of NAMES."""
    inertia, damping, stiffness, gravity, friction, stribeck, v_s, alpha = p[:8]
    motor, external, motor_s, external_s, quadratic_m, quadratic_e, delay, bias, b_s = p[8:]
    h = period / PARTS
    q, v = 0.0, 0.0
    out = np.zeros(u.size)
    for k in range(u.size * PARTS):
        late = int(np.floor((k * h - delay) / period + 1e-9))
        torque = u[late] if late >= 0 else 0.0
        load = -stiffness * q - gravity * np.sin(q)
        fading = np.exp(-(np.abs(v / v_s) ** alpha))
        limit = friction + fading * stribeck + np.abs(external * load - motor * torque)
        limit += fading * np.abs(external_s * load - motor_s * torque)
        if load * torque < 0.0:
            if np.abs(load) < np.abs(torque):
                limit += fading * quadratic_e * load * load
            else:
                limit += fading * quadratic_m * torque * torque
        limit += damping * np.abs(v)
        net = torque + load
        stop = net + v * inertia / h
        v += (net - min(max(stop, -limit), limit)) * h / inertia
        q += v * h
        if k % PARTS == PARTS - 1:
            out[k // PARTS] = (stiffness * q + b_s * v if torque_output else q) + bias
    return out
