"""Parts that cannot add energy don't: with no command, the energy stored only falls."""

from __future__ import annotations

import numpy as np
import pytest
from independent.equations import DB, DC, DG, DH, B, C, G, H, Z
from independent.hidden import hide
from independent.plant import Bench
from independent.solvers import run_fixed

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
