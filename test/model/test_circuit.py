"""The equivalent circuit: its nodal analysis is the equations of motion, and Table 1 the impedances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from random_rigs import RIG_NAMES, rigs

from rsea_ros.errors import ParameterError
from rsea_ros.model import outputs
from rsea_ros.model.equations import PORTS
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.paper.circuit import Element, circuit, circuit_response, impedance, nodal_analysis
from rsea_ros.paper.rival_models import lumped_rig

HZ = np.geomspace(0.05, 300.0, 12)


def worst(rig) -> float:
    """Return the largest difference of circuit and equations of motion, of each reading's largest value."""
    what = {end: outputs.end_torque(rig, end) for end in ("housing_end", "spring_end")}
    what |= {"position": outputs.position(), "deflection": outputs.deflection()}
    read = {port: circuit_response(rig, HZ, port) for port in PORTS}
    errors = []
    for name, output in what.items():
        expected = np.array([frequency_response(rig, output, HZ, port) for port in PORTS])
        ours = np.array([read[port][name] for port in PORTS])
        errors.append(np.abs(ours - expected).max() / max(np.abs(expected).max(), 1e-9))
    return float(max(errors))


@settings(max_examples=25)
@given(rigs(gravity=True))
def test_nodal_analysis_is_the_equations_of_motion(rig):
    assert worst(rig) < 1e-9
    assert worst(replace(rig, train="lumped")) < 1e-9


@pytest.mark.parametrize("name", RIG_NAMES)
def test_the_circuit_of_every_shipped_rig_is_its_equations_of_motion(name):
    assert worst(load_rig(name)) < 1e-9
    assert worst(lumped_rig(load_rig(name))) < 1e-9


def test_impedances_are_those_of_table_1():
    """K/s is 1/(C s) with C = 1/K, J s is L s, B is R; a gear takes an impedance to its ratio squared."""
    s = 2j * np.pi * 3.0
    for kind, value, expected in (
        ("stiffness", 8.0, 8.0 / s),
        ("inertia", 2.0, 2.0 * s),
        ("damping", 5.0, 5.0),
    ):
        assert impedance(Element("x", kind, ("a", "0"), value), s) == pytest.approx(expected)
        direct = [Element("u", "source", ("0", "a")), Element("x", kind, ("a", "0"), value)]
        assert 1.0 / nodal_analysis(direct, s, "u").current["x"] == pytest.approx(expected)
        geared = [Element("u", "source", ("0", "a")), Element("t", "transformer", ("a", "0", "b", "0"), 7.0),
                  Element("x", kind, ("b", "0"), value)]  # fmt: skip
        assert 1.0 / nodal_analysis(geared, s, "u").current["t"] == pytest.approx(49.0 * expected)


def test_an_infinite_impedance_is_an_open_branch_not_a_short_circuit():
    """Paper, section 2.2, has it the other way: a short circuit takes no torque at all."""
    rig = load_rig("paper_high_impedance")
    held = circuit_response(rig, HZ)["spring_end"]
    heavy = {f"spring_end.{key}": 1e8 for key in ("inertia", "damping", "stiffness")}
    loose = replace(rig.with_values(heavy), clamped=frozenset({"housing_end"}))
    np.testing.assert_allclose(circuit_response(loose, HZ)["spring_end"], held, rtol=1e-5)
    s = 2j * np.pi * 5.0
    shorted = [*circuit(rig), Element("wire", "damping", ("c", "0"), 0.0)]
    assert abs(nodal_analysis(shorted, s, "gear").voltage["c"]) < 1e-12


def test_an_unknown_source_is_refused():
    with pytest.raises(ParameterError, match="no source 'wind'"):
        circuit_response(load_rig("paper_high_impedance"), HZ, "wind")
