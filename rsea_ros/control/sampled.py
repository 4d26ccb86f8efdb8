"""The bench as a controller meets it: torque held over a sample, readings at its end. Exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from rsea_ros.errors import ParameterError
from rsea_ros.model import outputs, propagator
from rsea_ros.model.equations import PORTS
from rsea_ros.model.outputs import Output
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import read
from rsea_ros.records.record import ComplexArray, FloatArray

FT, VELOCITY, POSITION, LINK = range(4)


@dataclass(frozen=True)
class Sampled:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k]: y is ft (N m), velocity (rad/s) and position (rad) of the
    gear, and position (rad) of the link, all against the housing.

    a: shape (n, n). b: shape (n,). c: shape (4, n). period: s.
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    period: float


def sample_rig(rig: Rig, rate: float) -> Sampled:
    """Return a rig behind a zero-order hold at `rate`, Hz. Its effects are left out.

    Raises ParameterError for a rig whose torque a controller cannot feel.
    """
    check_controllable(rig)
    position = outputs.position()
    velocity = Output(np.roll(position.c, 1, axis=0), position.d)
    wanted = (outputs.end_torque(rig, rig.ft_end), velocity, position, outputs.link())
    system = propagator.state_space(rig)
    n = len(system.a)
    generator = np.zeros((n + 1, n + 1))
    generator[:n] = np.column_stack([system.a, system.b[:, PORTS.index("gear")]])
    held = expm(generator / rate)
    return Sampled(held[:n, :n], held[:n, n], np.vstack([read(system, o)[0] for o in wanted]), 1.0 / rate)


def check_controllable(rig: Rig) -> None:
    """Raise ParameterError for a rig without a spring, or whose F/T sensor is not at the spring's end."""
    if rig.rigid_spring:
        raise ParameterError(
            f"rig {rig.name}: spring.rigid = True, expected a spring whose torque is controlled"
        )
    if rig.ft_end != "spring_end":
        raise ParameterError(f"rig {rig.name}: ft_end = {rig.ft_end}, expected spring_end for torque control")


def responses(plant: Sampled, hz: FloatArray) -> ComplexArray:
    """Return the outputs of `Sampled` per N m at frequencies, Hz, below half the rate: shape (4, n)."""
    z = z_of(plant.period, hz)[:, None, None]
    x = np.linalg.solve(z * np.eye(len(plant.a)) - plant.a, plant.b[:, None].astype(complex))[..., 0]
    response: ComplexArray = plant.c @ x.T
    return response


def z_of(period: float, hz: FloatArray) -> ComplexArray:
    """Return exp(2 pi i f T)."""
    z: ComplexArray = np.exp(2j * np.pi * period * np.asarray(hz, dtype=np.float64))
    return z
