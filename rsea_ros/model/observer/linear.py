"""The linear model of the filter: mechanics, disturbance, and the encoder's zero where that is unknown.

    z = (q, q', d[, zero]),   z' = A z + w,   d the disturbance torque on the gear output, against the housing

Measured and estimated signals are rows on z. The torques on both ends have torques at the ports in them at
once (outputs.py): y = C x + D tau.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.equations import PORTS
from rsea_ros.model.outputs import Output
from rsea_ros.model.propagator import StateSpace, state_space
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

_GEAR = PORTS.index("gear")
ANGLE, SPEED = 1.0, 100.0
"""One sigma of what is not known at all at the start, rad, rad/s: far more than a bench has."""


@dataclass(frozen=True)
class LinearModel:
    """a: shape (n, n). block: [[A, B], [0, 0]] of the mechanics without gravity, for the mean.

    estimated: rows of T_d and T_p on z, shape (2, n). torques: rows on the torques at equations.PORTS,
    shape (2, 5). start: sigmas of z at the beginning but for the disturbance's, shape (n,).
    """

    a: FloatArray
    block: FloatArray
    estimated: FloatArray
    torques: FloatArray
    start: FloatArray

    @property
    def order(self) -> int:
        """Number of mechanical states, 2 for each coordinate."""
        return len(self.block) - len(PORTS)


def linear_model(rig: Rig) -> LinearModel:
    """Return the filter's model of a rig whose effects have changed its structure already."""
    falling, system = state_space(rig), state_space(rig, linear_gravity=False)
    n, zero = len(system.a), rig.zero_unknown("position")
    size = n + 1 + zero
    a, block = np.zeros((size, size)), np.zeros((n + len(PORTS), n + len(PORTS)))
    a[:n, :n], a[:n, n] = falling.a, falling.b[:, _GEAR]
    block[:n, :n], block[:n, n:] = system.a, system.b
    rows = [_rows(system, output) for output in (outputs.distal(rig), outputs.proximal(rig))]
    torques = np.array([d for _, d in rows])
    estimated = np.zeros((2, size))
    estimated[:, :n], estimated[:, n] = [c for c, _ in rows], torques[:, _GEAR]
    half = n // 2
    start = np.array([ANGLE] * half + [SPEED] * half + [0.0] + [ANGLE] * zero)
    return LinearModel(a, block, estimated, torques, start)


def _rows(system: StateSpace, output: Output) -> tuple[FloatArray, FloatArray]:
    """Return C, shape (n,), and D, shape (5,), of an output: q'' comes from the equations of motion."""
    placed, half = output.c @ system.mechanics.placement, system.mechanics.order
    c = np.concatenate([placed[0], placed[1]]) + placed[2] @ system.a[half:]
    return c, output.d + placed[2] @ system.b[half:]
