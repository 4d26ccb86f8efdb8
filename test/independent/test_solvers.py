"""The second bench solves its equations: against scipy, a linear system's answer, and its energy."""

from __future__ import annotations

import numpy as np
import pytest
from independent.equations import (
    DB,
    DC,
    DG,
    DH,
    SIZE,
    B,
    C,
    G,
    H,
    Z,
    right_hand_side,
    sensor_torque,
    sensor_torques,
)
from independent.hidden import hide
from independent.plant import Bench
from independent.solvers import run_adaptive, run_fixed
from scipy.signal import StateSpace, lsim

PERIOD = 1.0 / 280.0
HIDDEN = {
    "nominal": ({}, {}),
    "stribeck_friction": ({"coulomb_torque": 1.0, "stribeck_torque": 1.0, "stribeck_velocity": 0.05}, {}),
    "backlash": ({"gap": 2.0e-3}, {}),
    "spring_hysteresis": ({"torque": 1.0, "angle": 2.0e-3}, {}),
    "structural_resonance": ({"frequency": 48.0, "damping_ratio": 0.02, "participation": 0.5}, {}),
    "command_delay": ({"delay": 5.4e-3}, {}),
    "base_compliance": ({"stiffness": 9.0e3, "inertia": 0.5}, {}),
    "hard_stop": ({"angle": 8.0e-3, "stiffness": 5.0e3}, {}),
    "gear_compliance": ({"stiffness": 2.0e3}, {}),
}


def _command(n, seed=0):
    return 15.0 * np.random.default_rng(seed).normal(size=n) + 20.0 * np.sin(np.arange(n) / 15.0)


@pytest.mark.parametrize("effect", HIDDEN)
def test_fixed_steps_agree_with_an_adaptive_solver(effect):
    parameters, values = HIDDEN[effect]
    bench = hide(Bench(), effect, parameters) if parameters else Bench()
    plant = bench.with_values(duration=0.2, **values).plant
    command, calm = _command(56), np.zeros(56)
    fixed, held = run_fixed(command, calm, PERIOD, plant)
    adaptive, held_adaptive = run_adaptive(command, calm, PERIOD, plant, rtol=1e-7, atol=1e-10)
    times = (np.arange(command.size) + 1) * PERIOD
    torque, expected = (sensor_torques(times, states, plant) for states in (fixed, adaptive))
    np.testing.assert_array_equal(held, held_adaptive)
    assert np.std(torque - expected) < 0.005  # a sixth of the sensor's noise
    assert np.std(fixed[:, G] - adaptive[:, G]) < 3.6e-6  # the noise of the encoder's quantum


def test_without_effects_it_is_the_linear_system_of_the_paper():
    plant = Bench().plant
    inertia, damping = plant.j_m + plant.j_sc, plant.b_m + plant.b_s
    system = StateSpace(
        [[0.0, 1.0], [-plant.k_s / inertia, -damping / inertia]],
        [[0.0], [1.0 / inertia]],
        [[plant.k_s, plant.b_s], [1.0, 0.0], [0.0, 1.0]],
        np.zeros((3, 1)),
    )
    command = _command(1401)
    _, exact, _ = lsim(system, command, np.arange(command.size) * PERIOD, interp=False)
    states, _ = run_fixed(command[:-1], np.zeros(1400), PERIOD, plant)
    torque = sensor_torques((np.arange(1400) + 1) * PERIOD, states, plant)
    np.testing.assert_allclose(torque, exact[1:, 0], atol=1e-6)
    np.testing.assert_allclose(states[:, G], exact[1:, 1], atol=1e-9)
    np.testing.assert_allclose(states[:, DG], exact[1:, 2], atol=1e-8)


@pytest.mark.parametrize(
    ("frequency", "decibels"),
    [(1.3, -53.5), (20.0, -8.86)],
)
def test_moving_output_has_the_papers_unlumped_response(frequency, decibels):
    """T_ft/T_m with the rotor as an inerter between housing and chassis."""
    plant = Bench().with_values(housing_free=1.0).plant
    response = _response(plant, 2j * np.pi * frequency)
    assert 20.0 * np.log10(abs(response)) == pytest.approx(decibels, abs=0.05)


def _response(plant, s):
    """F/T torque per motor torque from the right-hand side's matrices, by unit columns (it is linear)."""

    def column(x, u):
        dx = np.empty(SIZE)
        right_hand_side(dx, 0.0, x, u, 0.0, plant)
        return dx

    a = np.stack([column(unit, 0.0) for unit in np.eye(SIZE)], axis=1)
    b = column(np.zeros(SIZE), 1.0)
    c = np.array([sensor_torque(0.0, unit, plant) for unit in np.eye(SIZE)])
    used = np.flatnonzero(np.abs(a).sum(axis=0) + np.abs(a).sum(axis=1) + np.abs(b))
    square = s * np.eye(used.size) - a[np.ix_(used, used)]
    return c[used] @ np.linalg.solve(square, b[used])


PASSIVE = {
    "coulomb_friction": {"torque": 2.0},
    "stribeck_friction": {"coulomb_torque": 1.0, "stribeck_torque": 1.0, "stribeck_velocity": 0.05},
    "asymmetric_friction": {"offset": 0.0, "viscous_difference": 8.0},
    "load_dependent_friction": {"coefficient": 0.1},
    "backlash": {"gap": 3.0e-3},
    "nonlinear_spring": {"cubic": 500.0},
    "spring_hysteresis": {"torque": 2.0, "angle": 2.0e-3},
    "base_compliance": {"stiffness": 9.0e3, "inertia": 0.5},
    "hard_stop": {"angle": 5.0e-3, "stiffness": 5.0e3},
    "gear_compliance": {"stiffness": 2.0e3},
}


def _energy(states, p):
    """Kinetic and elastic energy of all bodies, J, shape (n,)."""
    apart = p.gap > 0.0 or p.gear_k > 0.0
    chassis, speed = (C, DC) if apart else (G, DG)
    d = states[:, chassis] - states[:, B]
    rotor_speed = states[:, DG] + states[:, DH] * (1.0 - p.ratio) / p.ratio
    kinetic = 0.5 * p.j_m * rotor_speed**2 + 0.5 * p.j_sc * states[:, speed] ** 2
    kinetic += 0.5 * p.j_h * states[:, DH] ** 2 + 0.5 * p.base_j * states[:, DB] ** 2
    elastic = 0.5 * p.k_s * d**2 + 0.25 * p.k_s * p.cubic * d**4
    elastic += 0.5 * p.stop_k * np.maximum(np.abs(d) - p.stop_angle, 0.0) ** 2
    elastic += 0.5 * p.bouc_wen * p.bouc_wen_angle * states[:, Z] ** 2
    elastic += 0.5 * p.base_k * states[:, B] ** 2 + 0.5 * p.k_h * states[:, H] ** 2
    between = states[:, G] - states[:, C]
    elastic += 0.5 * p.gear_k * between**2
    if p.gap > 0.0:
        elastic += 0.5 * p.contact_k * np.maximum(np.abs(between) - 0.5 * p.gap, 0.0) ** 2
    return kinetic + elastic


@pytest.mark.parametrize("housing_free", [0.0, 1.0])
@pytest.mark.parametrize("effect", [None, *PASSIVE])
def test_energy_only_falls_when_nothing_drives(effect, housing_free):
    bench = hide(Bench(), effect, PASSIVE[effect]) if effect else Bench()
    plant = bench.with_values(housing_free=housing_free).plant
    command = np.zeros(420)
    command[:140] = 25.0 * np.random.default_rng(1).normal(size=140) + 15.0
    states, _ = run_fixed(command, np.zeros(420), 1.0 / 280.0, plant)
    energy = _energy(states, plant)[139:]
    assert energy[0] > 0.01
    assert np.all(np.diff(energy) <= 1e-9 * energy[0])
    assert energy[-1] < 0.9 * energy[0]  # a pendulum in the air goes on for long
