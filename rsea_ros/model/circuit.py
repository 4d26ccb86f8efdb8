"""The equivalent circuit of any rig: the paper's Figs. 6 to 8 as a netlist.

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
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from rsea_ros.model.equations import PORTS, rotor_inertia, train_ratio
from rsea_ros.model.netlist import GROUND, Element, Kind, NodalSolution, nodal_analysis
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray

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
