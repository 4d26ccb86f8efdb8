"""Fig. 18's models, compared off any grid: where each resonates, and how far apart two of them come."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from rsea_ros.model import outputs
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.rival_models import lumped_rig
from rsea_ros.records.record import FloatArray

_HZ: FloatArray = np.geomspace(0.1, 140.0, 400)


def readings(rig: Rig) -> dict[str, Rig]:
    """Return the models that Fig. 18 may compare: unlumped, and the lumped one in both readings.

    With moving loads only the rotor is grounded (`train: lumped`), as within the inner line of Fig. 16; the
    other takes the motor for a torque against the ground as well (lumped.py), as in Fig. 3.
    """
    return {
        "unlumped": rig,
        "lumped, loads moving": replace(rig, train="lumped"),
        "lumped, motor grounded": lumped_rig(rig),
    }


def resonance_hz(rig: Rig, low: float = 3.0) -> float:
    """Return where the torque at the spring end is largest above low, Hz."""
    hz = _HZ[low <= _HZ]
    return _sharpen(
        hz, int(np.argmax(_decibel(rig, hz))), lambda f: -float(_decibel(rig, np.array([f]))[0])
    )


def largest_gap(rig: Rig, other: Rig) -> tuple[float, float]:
    """Return where two models are furthest apart, Hz, and by how much, dB."""

    def gap(hz: FloatArray) -> FloatArray:
        return np.abs(_decibel(rig, hz) - _decibel(other, hz))

    f = _sharpen(_HZ, int(np.argmax(gap(_HZ))), lambda f: -float(gap(np.array([f]))[0]))
    return f, float(gap(np.array([f]))[0])


def _decibel(rig: Rig, hz: FloatArray) -> FloatArray:
    response = frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz)
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _sharpen(hz: FloatArray, at: int, cost: Callable[[float], float]) -> float:
    """Return the minimum of a cost over log frequency, between the neighbours of a grid point."""
    low, high = (math.log(hz[k]) for k in (max(at - 1, 0), min(at + 1, len(hz) - 1)))
    best = minimize_scalar(lambda x: cost(math.exp(x)), bounds=(low, high), method="bounded")
    return math.exp(best.x)
