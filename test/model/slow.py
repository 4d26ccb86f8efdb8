"""The slow and obvious computation: energies, states, held commands; no code of `rsea_ros.model`'s step."""

import math

import numpy as np
from rolling import rotor_speed
from scipy.linalg import expm

MOVABLE = ("housing", "gear", "chassis", "distal", "proximal")


def coordinates(rig):
    """Return the angles of the parts in MOVABLE by free coordinate, shape (5, n)."""
    names = ["gear"]
    names += ["chassis"] if math.isfinite(rig["gear.stiffness"]) else []
    names += [] if rig.rigid_spring else ["distal"]
    follow = {"gear": "gear", "chassis": "chassis" if "chassis" in names else "gear", "housing": "housing"}
    follow["distal"] = "distal" if "distal" in names else follow["chassis"]
    elastic = math.isfinite(rig["proximal_spring.stiffness"])
    follow["proximal"] = "proximal" if elastic else "housing"
    names = ["housing", *names, *(["proximal"] if elastic else [])]
    if "housing_end" in rig.clamped:
        names.remove(follow["proximal"])
    if "spring_end" in rig.clamped:
        names.remove(follow["distal"])
    return np.array([[1.0 if follow[part] == name else 0.0 for name in names] for part in MOVABLE])


def kinetic(rig, w):
    """Return the kinetic energy at speeds w of the parts in MOVABLE, J."""
    ratio = rig["gear.ratio"]
    rotor = rotor_speed(rig.train, ratio, w[0], w[1])
    energy = rig["rotor.reflected_inertia"] / ratio**2 * rotor**2 + rig["chassis.inertia"] * w[2] ** 2
    energy += rig["housing.inertia"] * w[0] ** 2
    return 0.5 * (energy + sum(_end(rig, end, "inertia") * w[i] ** 2 for i, end in _ENDS))


def dissipation(rig, w):
    """Return half the power lost, W."""
    inside = rig["rotor.reflected_damping"] * (w[1] - w[0]) ** 2 + rig["spring.damping"] * (w[2] - w[3]) ** 2
    inside += rig["gear.damping"] * (w[1] - w[2]) ** 2
    inside += rig["proximal_spring.damping"] * (w[4] - w[0]) ** 2
    return 0.5 * (inside + sum(_end(rig, end, "damping") * w[i] ** 2 for i, end in _ENDS))


def potential(rig, q, *, small_angles=False):
    """Return the energy in springs and in gravity, J."""
    energy = 0.0 if rig.rigid_spring else 0.5 * rig["spring.stiffness"] * (q[2] - q[3]) ** 2
    if math.isfinite(rig["gear.stiffness"]):
        energy += 0.5 * rig["gear.stiffness"] * (q[1] - q[2]) ** 2
    if math.isfinite(rig["proximal_spring.stiffness"]):
        energy += 0.5 * rig["proximal_spring.stiffness"] * (q[4] - q[0]) ** 2
    for i, end in _ENDS:
        rise = 0.5 * q[i] ** 2 if small_angles else 1.0 - math.cos(q[i])
        energy += 0.5 * _end(rig, end, "stiffness") * q[i] ** 2 + _end(rig, end, "gravity") * rise
    return energy


_ENDS = ((4, "housing_end"), (3, "spring_end"))


def _end(rig, end, key):
    return 0.0 if end in rig.clamped else rig[f"{end}.{key}"]


def quadratic(form, p):  # type: ignore[no-untyped-def]
    """Return A of form(P x) = 1/2 x' A x, by polarisation."""
    n = p.shape[1]
    basis = np.eye(n)
    single = [form(p @ e) for e in basis]
    return np.array(
        [[form(p @ (basis[i] + basis[j])) - single[i] - single[j] for j in range(n)] for i in range(n)]
    )


def state_matrices(rig):
    """Return A, B (motor torque) and C (position, velocity, ft) of the small motions, from the energies."""
    p = coordinates(rig)
    mass = quadratic(lambda w: kinetic(rig, w), p)
    damping = quadratic(lambda w: dissipation(rig, w), p)
    stiffness = quadratic(lambda q: potential(rig, q, small_angles=True), p)
    n = p.shape[1]
    a, b, c = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.zeros((3, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n], a[n:, n:] = -np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)
    b[n:] = np.linalg.solve(mass, p[1] - p[0])
    c[0, :n] = c[1, n:] = p[2] - p[0]
    if rig.ft_end == "housing_end":
        stiffness, damping = rig["proximal_spring.stiffness"], rig["proximal_spring.damping"]
        c[2] = np.concatenate([stiffness * (p[4] - p[0]), damping * (p[4] - p[0])])
    elif not rig.rigid_spring:
        c[2] = np.concatenate(
            [rig["spring.stiffness"] * (p[2] - p[3]), rig["spring.damping"] * (p[2] - p[3])]
        )
    return a, b, c


def respond(rig, stamps, command, wanted):
    """Return position, velocity, ft at the wanted times, shape (3, n): exact from event to event, no grid."""
    a, b, c = state_matrices(rig)
    n = len(b)
    events = np.unique(np.concatenate([stamps, wanted[wanted > stamps[0]]]))
    held = command[np.clip(np.searchsorted(stamps, events, side="right") - 1, 0, None)]
    spans, which = np.unique(np.round(np.diff(events), 13), return_inverse=True)
    blocks = np.zeros((len(spans), n + 1, n + 1))
    blocks[:, :n, :n], blocks[:, :n, n] = a * spans[:, None, None], b * spans[:, None]
    steps, x, states = expm(blocks), np.zeros(n), {events[0]: np.zeros(n)}
    for then, i, u in zip(events[1:], which, held, strict=False):
        x = steps[i, :n, :n] @ x + steps[i, :n, n] * u
        states[then] = x
    return c @ np.array([states[max(t, events[0])] for t in wanted]).T


def closed_loop(rig, law, period, parts, count):
    """Return position and velocity at the end of each of `count` periods, shape (2, count).

    law: the torque of (period, position, velocity, step), held over the `parts` steps of a period.
    """
    a, b, c = state_matrices(rig)
    n, step = len(b), period / parts
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a * step, b * step
    phi, x, states = expm(block), np.zeros(n), []
    for k in range(parts * count):
        x = phi[:n, :n] @ x + phi[:n, n] * law(k / parts, c[0] @ x, c[1] @ x, step)
        states.append(c[:2] @ x)
    return np.array(states[parts - 1 :: parts]).T
