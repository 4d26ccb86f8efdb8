"""Frequency response of any rig, straight from its equations of motion: a small solve for each frequency."""

from __future__ import annotations

import numpy as np

from rsea_ros.model.equations import PORTS, mechanics
from rsea_ros.model.outputs import Output
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray


def frequency_response(rig: Rig, output: Output, hz: FloatArray, port: str = "gear") -> ComplexArray:
    """Return output over torque at a port, (M s^2 + D s + K) q = B tau with s = 2 pi i f.

    hz: shape (n,), without 0 where the rig is free to turn as a whole. Returns shape (n,), in the output's
    unit per N m. A pendulum counts as its small-angle stiffness; the rig's effects are left out.
    """
    m = mechanics(rig)
    p = PORTS.index(port)
    s = 2j * np.pi * np.asarray(hz, dtype=np.float64)[:, None, None]
    q = (
        np.linalg.solve(m.mass * s**2 + m.damping * s + m.stiffness, m.ports[p][:, None])[..., 0]
        @ m.placement.T
    )
    s = s[:, 0, 0]
    response: ComplexArray = (np.stack([s**0, s, s**2], axis=1) @ output.c * q).sum(axis=1) + output.d[p]
    return response
