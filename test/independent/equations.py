"""Equations of motion of the second bench, compiled, as one right-hand side for any solver.

Generalised coordinates: housing h, gear output g, chassis c, base b. The rotor turns at
w_h + N (w_g - w_h), so that with J_r = J_m/N^2 it is an inerter between housing and gear output:

    [J_h + J_r (1-N)^2   J_r N (1-N)] [a_h]   [-T - k_h h - b_h w_h]
    [J_r N (1-N)         J_r N^2    ] [a_g] = [ T - T_gear         ]

T: motor torque less gear friction, T_gear: torque from the gear output on the chassis. A chassis
that is rigid with the gear output adds J_sc to the last element and T_gear is the spring's torque.
"""

import math

import numpy as np
from numba import njit

H, DH, G, DG, C, DC, B, DB, Z, BRISTLE, CURRENT, DCURRENT, R, DR, FT = range(15)
SIZE = 15


@njit(cache=True)
def motor_torque(x, u, p):
    """Torque that the current makes, with the nominal torque constant, N m."""
    return x[CURRENT] if p.current_tau > 0.0 or p.current_omega > 0.0 else u


@njit(cache=True)
def deflection(x, p):
    """Return deflection (rad) and its rate of the spring."""
    if p.gap > 0.0 or p.gear_k > 0.0:
        return x[C] - x[B], x[DC] - x[DB]
    return x[G] - x[B], x[DG] - x[DB]


@njit(cache=True)
def spring_torque(t, x, p):
    """Torque of the spring, N m: K(t) d (1 + quadratic d + cubic d^2) + b_s d' + Bouc-Wen + stop."""
    d, v = deflection(x, p)
    k_s = p.k_s * (1.0 + p.stiffness_drift * t / p.duration)
    torque = k_s * d * (1.0 + p.quadratic * d + p.cubic * d * d) + p.b_s * v + p.bouc_wen * x[Z]
    beyond = abs(d) - p.stop_angle
    if beyond > 0.0:
        torque += math.copysign(p.stop_k * beyond, d)
    return torque


@njit(cache=True)
def gear_torque(x, p):
    """Torque from gear output to chassis: two flanks with a gap, or an elastic gear, N m."""
    d, v = x[G] - x[C], x[DG] - x[DC]
    if p.gear_k > 0.0:
        return p.gear_k * d + p.gear_b * v
    pressed = abs(d) - 0.5 * p.gap
    if pressed <= 0.0:
        return 0.0
    side = math.copysign(1.0, d)
    return side * max(0.0, p.contact_k * pressed + p.contact_b * v * side)


@njit(cache=True)
def bristle_rate(x, v, p):
    """LuGre: z' = v - s0 |v| z / g(v)."""
    level = p.lugre_coulomb + p.lugre_stribeck * math.exp(-((v / p.stribeck_v) ** 2))
    return v - p.bristle_k * abs(v) * x[BRISTLE] / level


@njit(cache=True)
def friction(t, x, load, p):
    """All drag between housing and gear output, against the velocity w_g - w_h, N m."""
    v = x[DG] - x[DH]
    sign = math.tanh(v / p.v_0)
    forward = 0.5 * (1.0 + sign)
    dry = p.coulomb + p.stribeck * math.exp(-((v / p.stribeck_v) ** 2)) + p.load_friction * abs(load)
    if p.angle_friction > 0.0:
        dry += 0.5 * p.angle_friction * (1.0 + math.sin(2.0 * math.pi * (x[G] - x[H]) / p.angle_period))
    drag = p.b_m * (1.0 + p.damping_drift * t / p.duration) * v + dry * sign
    drag += p.friction_offset + 0.5 * p.viscous_difference * abs(v)
    drag += forward * (p.one_sided + p.one_sided_b * v)
    drag += p.quadratic_drag * v * abs(v)
    if p.bristle_k > 0.0:
        drag += p.bristle_k * x[BRISTLE] + p.bristle_b * bristle_rate(x, v, p)
    return drag


@njit(cache=True)
def waves(x, p):
    """Torque ripple over the rotor's angle and over the output's, N m."""
    angle = x[G] - x[H]
    torque = p.ripple * math.sin(p.ripple_cycles * p.ratio * angle + p.ripple_phase)
    return torque + p.cogging * math.sin(2.0 * math.pi * angle / p.cogging_period)


@njit(cache=True)
def move_bodies(dx, x, drive, to_chassis, spring, p):
    """Accelerations of housing, gear output, chassis and base."""
    apart = p.gap > 0.0 or p.gear_k > 0.0
    inertia = p.j_m if apart else p.j_m + p.j_sc
    force_g = drive - (to_chassis if apart else spring)
    dx[G], dx[C], dx[B] = x[DG], x[DC], x[DB]
    if p.housing_free > 0.0:
        couple = (1.0 - p.ratio) / p.ratio
        m_hh, m_hg = p.j_h + p.j_m * couple * couple, p.j_m * couple
        force_h = -drive - p.k_h * x[H] - p.b_h * x[DH]
        determinant = m_hh * inertia - m_hg * m_hg
        dx[H] = x[DH]
        dx[DH] = (inertia * force_h - m_hg * force_g) / determinant
        dx[DG] = (m_hh * force_g - m_hg * force_h) / determinant
    else:
        dx[DG] = force_g / inertia
    if apart:
        dx[DC] = (to_chassis - spring) / p.j_sc
    if p.base_k > 0.0:
        base_b = 2.0 * p.base_zeta * math.sqrt(p.base_k * p.base_j)
        dx[DB] = (spring - p.base_k * x[B] - base_b * x[DB]) / p.base_j


@njit(cache=True)
def mount_torque(x, spring, p):
    """Resonance between spring and sensor, T (1 - p s^2/(s^2 + 2 zeta w s + w^2)), N m."""
    w = p.resonance_omega
    return spring - p.resonance * (spring - 2.0 * p.resonance_zeta * w * x[DR] - w * w * x[R])


@njit(cache=True)
def sensor_torque(t, x, p):
    """Torque at the terminals of the F/T sensor, N m."""
    return x[FT] if p.ft_tau > 0.0 else mount_torque(x, spring_torque(t, x, p), p)


@njit(cache=True)
def sensor_torques(t, states, p):
    """Return the same for states of shape (n, SIZE) at times t (n,)."""
    out = np.empty(t.size)
    for k in range(t.size):
        out[k] = sensor_torque(t[k], states[k], p)
    return out


@njit(cache=True)
def move_signals(dx, x, u, spring, p):
    """Derivatives of the other states: current, resonance, lag before the sensor, hysteresis, bristle."""
    if p.current_omega > 0.0:
        w = p.current_omega
        dx[CURRENT] = x[DCURRENT]
        dx[DCURRENT] = w * w * (u - x[CURRENT]) - 2.0 * p.current_zeta * w * x[DCURRENT]
    elif p.current_tau > 0.0:
        dx[CURRENT] = (u - x[CURRENT]) / p.current_tau
    if p.resonance != 0.0:
        w = p.resonance_omega
        dx[R] = x[DR]
        dx[DR] = spring - 2.0 * p.resonance_zeta * w * x[DR] - w * w * x[R]
    if p.ft_tau > 0.0:
        dx[FT] = (mount_torque(x, spring, p) - x[FT]) / p.ft_tau
    if p.bouc_wen > 0.0:
        _, v = deflection(x, p)
        beta = p.bouc_wen_beta
        dx[Z] = (v - beta * abs(v) * x[Z] - (1.0 - beta) * v * abs(x[Z])) / p.bouc_wen_angle
    if p.bristle_k > 0.0:
        dx[BRISTLE] = bristle_rate(x, x[DG] - x[DH], p)


@njit(cache=True)
def right_hand_side(dx, t, x, u, knock, p):
    """Put dx/dt into dx: state x, held command u (N m), knock on the gear output (N m)."""
    dx.fill(0.0)
    spring = spring_torque(t, x, p)
    to_chassis = gear_torque(x, p) if p.gap > 0.0 or p.gear_k > 0.0 else spring
    gain = p.torque_gain * (1.0 + p.torque_fade * t / p.duration)
    drive = gain * motor_torque(x, u, p) + waves(x, p) + knock - friction(t, x, to_chassis, p)
    move_bodies(dx, x, drive, to_chassis, spring, p)
    move_signals(dx, x, u, spring, p)
