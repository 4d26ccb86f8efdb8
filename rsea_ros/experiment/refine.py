"""The shape near another that is worth most, by Nelder and Mead's method over its few numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_shape import Shape
from rsea_ros.progress import Progress
from rsea_ros.records.record import FloatArray


def refine(
    start: Shape, value: Callable[[Shape], float], asked: DesignRequest, say: Progress
) -> tuple[Shape, int]:
    """Return the shape near `start` of the largest value, and how many were rated."""
    names = {
        "multisine": ("bias", "amplitude", "low", "high", "tilt"),
        "chirp": ("bias", "amplitude", "low", "high"),
        "steps": ("bias", "amplitude", "hold"),
        "holds": ("bias", "amplitude", "hold"),
    }[start.kind]
    first = np.array([_inner(n, getattr(start, n)) for n in names])
    seen: list[tuple[float, Shape]] = []

    def loss(x: FloatArray) -> float:
        moved: dict[str, Any] = {n: _outer(n, float(v), asked) for n, v in zip(names, x, strict=True)}
        shape = replace(start, **moved)
        shape = replace(shape, high=max(shape.high, 1.5 * shape.low))
        seen.append((value(shape), shape))
        say("refining", 0.6 + 0.35 * min(1.0, len(seen) / max(asked.refine, 1)))
        return -seen[-1][0]

    if asked.refine:
        simplex = np.vstack([first, *(first + 0.25 * np.eye(len(first)))])
        options = {"maxfev": asked.refine, "initial_simplex": simplex, "xatol": 0.02, "fatol": 2e-3}
        minimize(loss, first, method="Nelder-Mead", options=options)
    return (max(seen, key=lambda item: item[0])[1] if seen else start), len(seen)


_LOGARITHMIC = ("low", "high", "hold")


def _inner(name: str, value: float) -> float:
    return math.log(value) if name in _LOGARITHMIC else value


def _outer(name: str, x: float, asked: DesignRequest) -> float:
    """Return the value of a shape's number within its sensible range."""
    value = math.exp(min(x, 50.0)) if name in _LOGARITHMIC else x
    low, high = {
        "bias": (-0.8, 0.8),
        "amplitude": (0.1, 1.0),
        "low": (0.05, 0.2 * asked.rate),
        "high": (1.0, 0.475 * asked.rate),
        "tilt": (-0.5, 1.5),
        "hold": (0.02, 2.0),
    }[name]
    return min(max(value, low), high)
