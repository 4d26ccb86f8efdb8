"""The paper's equivalent circuit, and its netlist.

0 --[load]-- p --[housing J_h]-- h --[Mu_2]-- m --[chassis J_sc]-- c --[load]-- 0
                 |                                |                    |
         [proximal spring]             [motor, b_m, Mu_1]     [spring K_s, b_s]
                 |                                |                    |
                 0                                0                    0

Currents: w_h through the housing, w_c through the chassis, w_d through the load at the spring's end; the
motor's branch carries w_g - w_h, the spring's w_c - w_d. Voltages: at p the torque T_p on the housing's end,
at c the torque T_d on the spring's. A clamped end is an open branch: no velocity. (The paper's text has a
short circuit there, which in this analogy is an end that takes no torque.)

The epicyclic train is a three-port, two ideal transformers on one inductor J_r = J_m / N^2 (node r):

    w_rotor = Mu_1 (w_g - w_h) + Mu_2 w_h

    planetary: Mu_1 = N, Mu_2 = 1    star: Mu_1 = -(N - 1), Mu_2 = 1    lumped: Mu_1 = Mu_2 = N

The paper writes Mu_1 = N + 1 = 502 and Mu_2 = -1: its N = 501 is annulus over sun, ours the whole reduction;
it counts the stator's current against ours. A lumped rotor turns as if the housing stood still.

Torque is voltage, angular velocity is current (impedance analogy, paper, section 2.2 and Table 1):

    stiffness K   K / s   capacitor, C = 1 / K          damping B   resistor, R = B
    inertia J     J s     inductor, L = J               gear        ideal transformer
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.model.equations import PORTS, rotor_inertia, train_ratio
from rsea_ros.model.rig import Rig
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


Part = tuple[str, Kind, float]


def circuit(rig: Rig) -> tuple[Element, ...]:
    """Return the netlist of a rig. Its sources, one in each branch, are named after equations.PORTS."""
    return (*_housing_side(rig), *_train(rig), *_distal_side(rig))


def circuit_response(rig: Rig, hz: FloatArray, port: str = "gear") -> Mapping[str, ComplexArray]:
    """Return the outputs of a rig per N m at a port, by nodal analysis. hz: shape (n,), above 0.

    position, deflection: rad. housing_end, spring_end: torques on the two ends, N m. Each of shape (n,).
    A port in a branch that is open (a clamped end, a rigid spring) moves nothing.
    """
    elements = circuit(rig)
    reads = ("position", "deflection", "housing_end", "spring_end")
    if port in PORTS and port not in {e.name for e in elements}:
        return {name: np.zeros(len(hz), complex) for name in reads}
    rows = [_read(nodal_analysis(elements, s, port), s) for s in 2j * math.pi * np.asarray(hz)]
    return {name: np.array([row[name] for row in rows]) for name in reads}


def _read(solution: NodalSolution, s: complex) -> dict[str, complex]:
    w = solution.current
    return {
        "position": (w["J_sc"] - w["Mu_2"]) / s,
        "deflection": w.get("K_s", 0j) / s,
        "housing_end": solution.voltage["p"],
        "spring_end": solution.voltage["c"],
    }


def _housing_side(rig: Rig) -> Iterator[Element]:
    if rig.end_is_free("housing_end"):
        yield from _chain(GROUND, "p", [("housing", "source", 1.0), *_load(rig, "housing_end", "hl")])
    if math.isfinite(rig["proximal_spring.stiffness"]):
        stiffness, damping = rig["proximal_spring.stiffness"], rig["proximal_spring.damping"]
        yield from _chain("p", GROUND, [("K_p", "stiffness", stiffness), ("b_p", "damping", damping)])
    yield Element("J_h", "inertia", ("p", "h"), rig["housing.inertia"])


def _train(rig: Rig) -> Iterator[Element]:
    n = train_ratio(rig)
    yield Element("Mu_2", "transformer", ("h", "m", "r", GROUND), n if rig.train == "lumped" else 1.0)
    yield Element("gear", "source", (GROUND, "m.1"))
    yield Element("b_m", "damping", ("m.1", "m.2"), rig["rotor.reflected_damping"])
    yield Element("Mu_1", "transformer", ("m.2", "m", "r", GROUND), n)
    yield Element("J_r", "inertia", ("r", GROUND), rotor_inertia(rig))


def _distal_side(rig: Rig) -> Iterator[Element]:
    if math.isfinite(rig["gear.stiffness"]):
        yield Element("K_g", "stiffness", ("m", "g.1"), rig["gear.stiffness"])
        yield Element("b_g", "damping", ("g.1", "g"), rig["gear.damping"])
        yield Element("joint", "source", (GROUND, "g"))
    yield Element("J_sc", "inertia", ("m", "c"), rig["chassis.inertia"])
    if not rig.rigid_spring:
        yield Element("K_s", "stiffness", ("c", "s.1"), rig["spring.stiffness"])
        yield Element("b_s", "damping", ("s.1", "s.2"), rig["spring.damping"])
        yield Element("spring", "source", (GROUND, "s.2"))
    if rig.end_is_free("spring_end"):
        yield from _chain("c", GROUND, [("distal", "source", 1.0), *_load(rig, "spring_end", "dl")])


def _load(rig: Rig, end: str, index: str) -> list[Part]:
    """Return inertia, damping and stiffness (a pendulum's small-angle one included) of the load on an end."""
    stiffness = rig[f"{end}.stiffness"] + rig[f"{end}.gravity"]
    parts: list[Part] = [
        (f"J_{index}", "inertia", rig[f"{end}.inertia"]),
        (f"b_{index}", "damping", rig[f"{end}.damping"]),
        (f"K_{index}", "stiffness", stiffness),
    ]
    return [part for part in parts if part[2]]


def _chain(start: str, stop: str, parts: Sequence[Part]) -> Iterator[Element]:
    """Yield branches in series from one node to another: the same velocity through all."""
    nodes = [start, *(f"{start}{stop}.{k}" for k in range(1, len(parts))), stop]
    for (name, kind, value), a, b in zip(parts, nodes, nodes[1:], strict=False):
        yield Element(name, kind, (a, b), value)
