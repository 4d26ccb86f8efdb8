"""Electrical netlists at one complex frequency, and their nodal analysis.

Torque is voltage, angular velocity is current (impedance analogy, paper, section 2.2 and Table 1):

    stiffness K   K / s   capacitor, C = 1 / K          damping B   resistor, R = B
    inertia J     J s     inductor, L = J               gear        ideal transformer
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.records.record import ComplexArray, FloatArray

Kind = Literal["stiffness", "inertia", "damping", "source", "transformer"]
GROUND = "0"


@dataclass(frozen=True)
class Element:
    """A branch between two nodes; the current is counted from the first to the second.

    value: N m/rad, kg m^2, N m s/rad; of a transformer its ratio. nodes: of a transformer primary + and -,
    secondary + and -. A source raises the voltage from its first node to its second by its value.
    """

    name: str
    kind: Kind
    nodes: tuple[str, ...]
    value: float = 0.0


@dataclass(frozen=True)
class NodalSolution:
    """voltage: torques by node, N m. current: velocities by element (of a transformer: primary), rad/s."""

    voltage: dict[str, complex]
    current: dict[str, complex]


def impedance(element: Element, s: complex) -> complex:
    """Return K / s, J s or B, N m s/rad."""
    if element.kind == "stiffness":
        return element.value / s
    return element.value * s if element.kind == "inertia" else complex(element.value)


def nodal_analysis(elements: Sequence[Element], s: complex, driven: str) -> NodalSolution:
    """Return all voltages and currents while one source has 1 N m and the others none.

    Modified nodal analysis (Ho, Ruehli, Brennan, IEEE TCAS 22, 1975): the unknowns are the voltages of the
    nodes and the currents of all branches; the rows are the sums of the currents at every node, then the law
    of every branch. Raises ParameterError for an unknown source.
    """
    if driven not in {e.name for e in elements if e.kind == "source"}:
        raise ParameterError(f"circuit: no source {driven!r} to drive, expected one of its sources")
    nodes = {n: i for i, n in enumerate(sorted({n for e in elements for n in e.nodes} - {GROUND}))}
    size = len(nodes) + len(elements)
    matrix, right = np.zeros((size, size), complex), np.zeros(size, complex)
    for k, element in enumerate(elements, start=len(nodes)):
        _stamp(matrix, nodes, k, element, s)
        right[k] = 1.0 if element.name == driven else 0.0
    x = _solve(matrix, right)
    voltage = {GROUND: 0j, **{n: complex(x[i]) for n, i in nodes.items()}}
    return NodalSolution(voltage, {e.name: complex(x[len(nodes) + k]) for k, e in enumerate(elements)})


def _stamp(matrix: ComplexArray, nodes: dict[str, int], k: int, e: Element, s: complex) -> None:
    """Put a branch into its nodes' sums (columns) and its law into row k."""
    gains = (1.0, -1.0) if e.kind != "transformer" else (1.0, -1.0, -e.value, e.value)
    for node, gain in zip(e.nodes, gains, strict=True):
        if node != GROUND:
            matrix[nodes[node], k] += gain
            matrix[k, nodes[node]] += -gain if e.kind == "source" else gain
    if e.kind not in ("source", "transformer"):
        matrix[k, k] -= impedance(e, s)


def _solve(matrix: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Solve with rows and columns scaled: stiffnesses and inertias lie twelve decades apart."""
    rows: FloatArray = 1.0 / np.abs(matrix).max(axis=1)
    columns: FloatArray = 1.0 / np.abs(rows[:, None] * matrix).max(axis=0)
    scaled = np.linalg.solve(rows[:, None] * matrix * columns, rows * right)
    solution: ComplexArray = columns * scaled
    return solution
