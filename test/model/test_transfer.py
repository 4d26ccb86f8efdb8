"""Transfer functions, state space and equations of motion agree; they contain the paper's."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from random_rigs import RIG_NAMES, WITH_SPRING, rigs

from rsea_ros.errors import RigError
from rsea_ros.identification.frequency_response import model_response
from rsea_ros.model import outputs, transfer
from rsea_ros.model.equations import PORTS
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import frequency_response, inner_inertia
from rsea_ros.paper import formulas
from rsea_ros.paper.rival_models import lumped_rig

HZ = np.geomspace(0.05, 300.0, 60)
S = 2j * np.pi * HZ
K_S, J_SC, B_S = 1530.456, 0.0040, 3.0
J_EFF, B_EFF = 0.953 + J_SC, 23.088 + B_S
EQ_1 = formulas.eq_1_lumped_distal_per_motor(K_S, J_EFF, B_EFF)


def read_outputs(rig):
    """Return everything that can be read of a rig, by name."""
    ends = {end: outputs.end_torque(rig, end) for end in ("housing_end", "spring_end")}
    return {"position": outputs.position(), "deflection": outputs.deflection(), **ends}


def distal_per_motor(rig, sees="spring_and_damper"):
    return transfer.transfer(rig, outputs.distal(rig, sees))


def proximal_per_motor(rig):
    return transfer.transfer(rig, outputs.proximal(rig))


def by_state_space(rig, output, port):
    """Return C (s I - A)^-1 B + D at every s."""
    system = state_space(rig)
    c, d = transfer.read(system, output)
    p = PORTS.index(port)
    b = system.b[:, p]
    return np.array([c @ np.linalg.solve(s * np.eye(len(b)) - system.a, b) + d[p] for s in S])


def agree(a, b, tolerance=1e-7):
    np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(np.abs(b).max(), 1e-12))


@settings(max_examples=10)
@given(rigs(gravity=True))
def test_polynomials_and_state_space_are_the_equations_of_motion(rig):
    for output in read_outputs(rig).values():
        for port in PORTS:
            expected = frequency_response(rig, output, HZ, port)
            agree(transfer.transfer(rig, output, port)(S), expected)
            agree(by_state_space(rig, output, port), expected)


@settings(max_examples=20)
@given(rigs(gravity=True))
def test_a_free_end_moves_by_the_torque_on_it(rig):
    """Newton on the end alone: the torque that it has to hold is what turns it."""
    for i, (end, sign) in enumerate((("housing_end", -1.0), ("spring_end", 1.0))):
        if end in rig.clamped:
            continue
        angle = outputs.Output(np.zeros((3, 5)), np.zeros(5))
        angle.c[0, (4, 3)[i]] = sign
        impedance = rig[f"{end}.inertia"] * S**2 + rig[f"{end}.damping"] * S
        impedance += rig[f"{end}.stiffness"] + rig[f"{end}.gravity"]
        held = impedance * frequency_response(rig, angle, HZ)
        agree(frequency_response(rig, outputs.end_torque(rig, end), HZ), held)


def test_the_high_impedance_response_is_the_papers_but_for_the_rotors_spin():
    rig = load_rig("paper_high_impedance")
    j = inner_inertia(rig)
    eq_5 = formulas.eq_5_proximal_per_motor(K_S, 0.953 / 502**2, 23.088 / 502**2, 502, j, B_S)
    eq_6 = formulas.eq_6_distal_per_proximal(K_S, j, B_S)
    agree(distal_per_motor(rig, "element")(S), EQ_1(S))
    agree(proximal_per_motor(rig)(S) * (J_EFF * S**2 + B_EFF * S + K_S), eq_5.numerator @ [S**2, S, S**0])
    agree(transfer.end_to_end(rig, "element")(S), eq_6(S))


@pytest.mark.parametrize("train", ["planetary", "star"])
def test_the_paper_is_the_limit_of_a_large_ratio(train):
    """T_p - T_d = (J_sc + n J_r) q'': the exact T_p comes to Eq. (5) as 1 / N."""
    base = replace(load_rig("paper_high_impedance"), train=train)
    errors = []
    for ratio in (50.0, 500.0, 5000.0, 50000.0):
        exact = proximal_per_motor(base.with_values({"gear.ratio": ratio}))(S)
        eq_5 = formulas.eq_5_proximal_per_motor(K_S, 0.953 / ratio**2, 23.088 / ratio**2, ratio, J_SC, B_S)
        errors.append(np.abs(exact - eq_5(S)).max())
    assert errors[-1] < 1e-4
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 10.0, rtol=0.1)


@pytest.mark.parametrize("name", RIG_NAMES)
@pytest.mark.parametrize("train", ["planetary", "star"])
def test_both_ends_together_take_the_change_of_angular_momentum(name, train):
    """Independent of the end's rows: T_p - T_d is s^2 of chassis and rotor momentum, the ends left out."""
    rig = replace(load_rig(name), train=train, proximal="housing_end")
    ratio = rig["gear.ratio"]
    n = ratio if train == "planetary" else 1 - ratio
    momentum = outputs.Output(np.zeros((3, 5)), np.zeros(5))
    momentum.c[2] = rig["rotor.reflected_inertia"] / ratio**2 * np.array([1 - n, n, 0, 0, 0])
    momentum.c[2, 2] += rig["chassis.inertia"]
    difference = proximal_per_motor(rig)(S) - distal_per_motor(rig)(S)
    agree(difference, frequency_response(rig, momentum, HZ))


def test_lumped_model_is_eqs_1_to_3():
    rig = lumped_rig(load_rig("paper_high_impedance"))
    agree(distal_per_motor(rig, "element")(S), EQ_1(S))
    agree(proximal_per_motor(rig)(S), transfer.Fraction([J_EFF, B_S, K_S], [J_EFF, B_EFF, K_S])(S))
    agree(transfer.end_to_end(rig, "element")(S), transfer.Fraction([K_S], [J_EFF, B_S, K_S])(S))


@pytest.mark.parametrize("name", WITH_SPRING)
def test_held_by_the_other_end_the_two_torques_change_places(name):
    rig = replace(load_rig(name), proximal="housing_end")
    other = replace(rig, proximal="spring_end")
    agree(distal_per_motor(other)(S), proximal_per_motor(rig)(S))
    agree(proximal_per_motor(other)(S), distal_per_motor(rig)(S))
    agree(transfer.end_to_end(other)(S), 1 / transfer.end_to_end(rig)(S))


def test_the_damper_turns_the_phase_of_what_the_sensor_sees():
    """K_s or K_s + b_s s in the numerator, more than 20 degrees apart from 30 Hz on."""
    rig = load_rig("paper_high_impedance")
    sees = distal_per_motor(rig)(S) / distal_per_motor(rig, "element")(S)
    agree(sees, 1 + B_S / K_S * S)
    lag = np.degrees(np.angle(sees))
    assert lag[HZ > 30].min() > 20 > lag[HZ < 29].max()


def test_the_element_of_a_rigid_spring_is_refused():
    with pytest.raises(RigError, match=r"bare_drive: spring.rigid = True, expected a spring"):
        distal_per_motor(load_rig("bare_drive"), "element")


@pytest.mark.parametrize("end", ["housing_end", "spring_end"])
@pytest.mark.parametrize("name", ["separate_stiffnesses", "two_moving_outputs"])
def test_a_fit_starts_from_the_response_of_the_end_with_the_sensor(name, end):
    """It was the spring's wherever the F/T sensor is: a quarter off at 40 Hz."""
    rig = replace(load_rig(name), ft_end=end)
    ours, expected = model_response(rig, "ft", HZ), transfer.end_response(rig, HZ, end)
    np.testing.assert_allclose(ours, expected, rtol=1e-6)
