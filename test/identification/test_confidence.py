"""The doubt of a fit beside the formulas of its sources, and what is said of values that data leave open."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from runs import RIG, excited

from rsea_ros.identification import confidence
from rsea_ros.identification.confidence import (
    BLOCK,
    Confidence,
    _without_the_rest,
    confidence_of,
    errors_by_channel,
    interval,
    inverse_of,
    is_off_rig,
    off_rig,
    overlays_of,
    parameters_of,
    sample_blocks,
    sum_by_block,
    torque_scale,
    undetermined_remarks,
)
from rsea_ros.identification.fit import fit
from rsea_ros.identification.problem import case_from
from rsea_ros.identification.result import ParameterEstimate, Remark, shares_from_data
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown
from rsea_ros.model.drive import Drive

RNG = np.random.default_rng(3)
T = 2.0 + 0.01 * np.arange(600)


def unknown(name, start=1.0, doubt=np.inf, *, low=-100.0, high=100.0, logarithmic=False):
    return Unknown(name, start, "1", low, high, logarithmic, doubt, 1.0)


def case(drive=None, **measured):
    y = {n: np.asarray(v, float) for n, v in measured.items()}
    return SimpleNamespace(
        start=2.0, duration=6.0, t=dict.fromkeys(y, T), measured=y, mask={n: np.ones(600, bool) for n in y},
        drive=Drive.__new__(Drive) if drive is None else drive,
    )  # fmt: skip


def problem(unknowns, *cases, loop=None, free=()):
    rig = SimpleNamespace(loop=loop, linear=False, free=lambda: free)
    return SimpleNamespace(unknowns=tuple(unknowns), cases=cases, rig=rig, present=lambda c: list(c.measured))


J, R = RNG.standard_normal((600, 3)), 2.0 * np.repeat(RNG.standard_normal(60), 10)
DOUBTS = np.array([0.5, 2.0, 1.0])


def solved(jacobian=J, residual=R, drive=None):
    measured = case(drive, ft=T)
    measured.mask["ft"] = np.arange(600) < len(residual)
    made = problem([unknown(n, doubt=d) for n, d in zip("abc", DOUBTS, strict=True)], measured)
    made.residual = lambda theta: J[: len(residual)] @ theta
    return Solution(made, np.array([1.0, 2.0, 3.0]), residual, jacobian, 0.0)


@pytest.mark.parametrize(("seconds", "corrected"), [(6, 6 / 3), (3, 4.0)])
def test_the_covariance_is_whites_sandwich_over_blocks_of_a_second_beside_the_prior(seconds, corrected):
    """Times n / (n - p) of n blocks and p unknowns, four at most."""
    j, r = J[: 100 * seconds], R[: 100 * seconds]
    found = confidence_of(solved(j, r))
    inverse = np.linalg.inv(j.T @ j + np.diag(1.0 / DOUBTS**2))
    scores = np.array([j[100 * k : 100 * k + 100].T @ r[100 * k : 100 * k + 100] for k in range(seconds)])
    assert BLOCK == 1.0
    middle = scores.T @ scores * corrected + np.diag(1.0 / DOUBTS**2)
    expected = inverse @ middle @ inverse
    larger = np.sqrt(np.maximum(1.0, np.diag(inverse) / np.diag(expected)))
    assert found.covariance == pytest.approx(expected * np.outer(larger, larger), rel=1e-6)
    assert found.information == pytest.approx(j.T @ j) and found.theta.tolist() == [1.0, 2.0, 3.0]
    sd = np.sqrt(np.diag(found.covariance))
    assert found.correlation == pytest.approx(found.covariance / np.outer(sd, sd))
    none = Confidence(np.zeros(2), np.diag([4.0, 0.0]), np.zeros(2), np.zeros((2, 2)))
    assert none.correlation.tolist() == [[1.0, 0.0], [0.0, 1.0]]


def test_a_doubt_is_never_less_than_noise_leaves_and_more_where_a_filter_correlates_samples():
    quiet = confidence_of(solved(residual=1e-6 * R))
    inverse = np.linalg.inv(J.T @ J + np.diag(1.0 / DOUBTS**2))
    assert np.diag(quiet.covariance) == pytest.approx(np.diag(inverse))
    grid = SimpleNamespace(t=0.001 * np.arange(9.0))  # filtered at 20 Hz: 25 samples are one
    alike = confidence_of(solved(residual=1e-6 * R, drive=grid))
    assert np.diag(alike.covariance) == pytest.approx(25.0 * np.diag(inverse))
    coarse = confidence_of(solved(residual=1e-6 * R, drive=SimpleNamespace(t=0.1 * np.arange(9.0))))
    assert np.diag(coarse.covariance) == pytest.approx(np.diag(inverse))


def test_weak_information_is_taken_by_central_differences(monkeypatch):
    asked = []
    monkeypatch.setattr(confidence, "central_jacobian", lambda p, theta, run: asked.append(1) or J)
    confidence_of(solved())
    assert not asked
    faint = 9.0 * J[:, 2] / np.linalg.norm(J[:, 2])
    weak = confidence_of(solved(jacobian=np.column_stack([J[:, :2], faint])))
    assert asked == [1] and weak.information == pytest.approx(J.T @ J)


def test_an_inverse_stands_unknowns_of_very_different_scales():
    matrix = np.array([[2.0, 0.3], [0.3, 1.0]])
    scale = np.array([1e9, 1e-6])
    whole = inverse_of(matrix * np.outer(scale, scale)) * np.outer(scale, scale)
    assert whole == pytest.approx(np.linalg.inv(matrix))
    singular = inverse_of(np.ones((2, 2)))
    assert np.diag(singular)[0] == pytest.approx(1.0 / (4.0 * 2.0 * np.finfo(float).eps), rel=0.01)


def test_scores_are_summed_by_block_and_blocks_of_cases_are_apart():
    rows, residual = np.arange(12.0).reshape(6, 2), np.array([1.0, 2.0, 0.5, 1.0, -1.0, 3.0])
    given = sum_by_block(rows, residual, np.array([0, 0, 2, 2, 2, 0]))
    assert given.tolist() == [[34.0, 40.0], [0.0, 0.0], [0.0, 0.5]]
    assert sum_by_block(np.empty((6, 0)), residual, np.array([0, 0, 2, 2, 2, 0])).shape == (3, 0)
    first, second = case(ft=T, position=T), case(ft=T)
    first.mask["ft"] = T < 4.0
    blocks = sample_blocks(problem([], first, second), 1.5)
    seconds = [T[T < 4.0], T, T]
    expected = [np.floor((t - 2.0 + 1e-9) / 1.5) + k for t, k in zip(seconds, (0, 0, 6), strict=True)]
    assert np.mean(blocks != np.concatenate(expected)) < 0.01


def test_an_interval_is_in_si_and_an_angle_has_half_a_turn_at_most():
    assert interval(unknown("k", logarithmic=True, low=1e-3), math.log(10.0), 0.1) == pytest.approx(
        (10.0 * math.exp(-0.1959964), 10.0 * math.exp(0.1959964)), rel=1e-6
    )
    angle = unknown("spring_end.gravity_angle")
    assert interval(angle, 1.0, 0.1) == pytest.approx((1.0 - 0.1959964, 1.0 + 0.1959964))
    assert interval(angle, 1.0, 5.0) == pytest.approx((1.0 - math.pi, 1.0 + math.pi))


def remarks(information, *unknowns, theta=None):
    at = np.ones(len(unknowns)) if theta is None else np.array(theta)
    given = Confidence(at, np.eye(len(at)), np.zeros(len(at)), np.array(information, float))
    return [(r.code, r.names) for r in undetermined_remarks(unknowns, given)]


def test_values_that_data_leave_open_are_named_alone_or_together():
    j, k = (unknown(n, doubt=1.0) for n in ("rotor.reflected_inertia", "spring.stiffness"))
    free, effect = unknown("spring.damping"), unknown("backlash.gap", doubt=1.0)
    clock = unknown("clock.ft", doubt=1.0)
    assert remarks([[9.0, 0.0], [0.0, 9.0]], j, k) == []
    assert remarks([[9.0, 0.0], [0.0, 0.9]], j, k) == [("only_prior", ("spring.stiffness",))]
    assert remarks([[9.0, 0.0], [0.0, 1.1]], j, k) == []
    assert remarks([[9.0, 0.0], [0.0, 0.0]], j, free) == [("not_shown", ("spring.damping",))]
    both = [[9.0, -9.0], [-9.0, 9.0]]
    assert remarks(both, j, k) == [("only_ratios", (j.name, k.name))]
    assert remarks(both, j, effect) == [("only_together", (j.name, effect.name))]
    assert remarks(both, j, k, theta=[1.0, 2.0]) == [("only_together", (j.name, k.name))]
    assert remarks(both, j, k, theta=[1.0, 6.0]) == [("only_prior", (j.name,))]
    assert remarks(both, j, k, theta=[1.0, 0.0]) == [("only_prior", (k.name,))]
    # a clock that is free takes the information of what it imitates, and is not named itself
    assert remarks(both, j, clock) == [("only_prior", (j.name,))]
    assert remarks([[0.0]], clock) == []
    at_bound = unknown("spring.stiffness", 0.5, doubt=1.0, high=1.0)
    assert remarks([[9.0, 0.0], [0.0, 0.0]], j, at_bound) == [("at_bound", ("spring.stiffness",))]
    vanished = unknown("spring.stiffness", 1.0, doubt=1.0, high=1.0)
    assert remarks([[9.0, 0.0], [0.0, 0.0]], j, vanished) == [("only_prior", ("spring.stiffness",))]


def test_what_others_imitate_is_no_information():
    whole = np.array([[4.0, 1.0, 2.0], [1.0, 3.0, 0.5], [2.0, 0.5, 5.0]])
    expected = np.linalg.inv(np.linalg.inv(whole)[np.ix_([0, 2], [0, 2])])
    assert _without_the_rest(whole, [0, 2]) == pytest.approx(expected)
    assert _without_the_rest(whole, [0, 1, 2]) == pytest.approx(whole)


def test_without_a_sensor_of_torque_its_basis_is_said():
    def code(*names, loop=None, ft=False):
        channels = {"ft": T} if ft else {"position": T}
        made = problem([unknown(n) for n in names], case(**channels), loop=loop)
        return [r.code for r in torque_scale(made)]

    assert code("spring.stiffness") == ["torque_by_motor_constant"]
    assert code("spring.stiffness", loop="pd") == ["torque_by_loop_gains"]
    assert code("torque_constant_error.gain") == [] == code("spring.stiffness", ft=True)


def estimate(off, told=0.99, name="spring.stiffness"):
    return ParameterEstimate(name, 900.0, "N m/rad", (890.0, 910.0), 1500.0, 0.1, told, off)


def test_a_value_is_off_the_rig_from_three_spreads_on_where_data_say_so():
    (remark,) = off_rig([estimate(3.1), estimate(2.9), estimate(3.1, 0.1), estimate(9.0, name="clock.ft")])
    assert (remark.code, remark.names, remark.unit) == ("off_rig", ("spring.stiffness",), "N m/rad")
    assert remark.values == (1500.0, 900.0, 890.0, 910.0, 3.1)
    assert off_rig([estimate(-3.1)])
    for theta, names, is_off in ((4.1, ("k",), True), (3.9, ("k",), False), (4.1, ("other",), False)):
        made = problem([unknown("k", doubt=1.0, start=-0.0)], case(ft=T), free=names)
        solution = Solution(made, np.array([theta - 1.0]), R, J, 0.0)
        assert is_off_rig(solution) == is_off


def test_estimates_and_errors_are_those_of_the_fit():
    made = solved()
    sd = np.array([0.1, 0.2, 0.3])
    shares = np.array([0.9, 0.8, 0.7])
    (a, _, c) = parameters_of(made, Confidence(made.theta, np.diag(sd**2), shares, J.T @ J))
    assert (a.name, a.value, a.start, a.told_by_data, a.spread) == ("a", 1.0, 1.0, 0.9, 0.5)
    assert c.ci95 == pytest.approx((3.0 - 0.3 * 1.959964, 3.0 + 0.3 * 1.959964)) and c.spreads_off > 1.0
    first, second = case(ft=T, position=2.0 * T), case(ft=T)
    first.mask["ft"] = T < 3.0
    outputs = [{"ft": T + 1.0, "position": T}, {"ft": T - 1.0}]
    errors = errors_by_channel(problem([], first, second), outputs)
    early = T[T < 3.0]
    assert errors["ft"][0] == pytest.approx(np.append(np.ones(len(early)), -np.ones(600)))
    assert errors["ft"][1] == pytest.approx(np.append(early, T))
    assert errors["position"][0] == pytest.approx(-T)
    (shown,) = overlays_of(first, {"ft": T + 1.0})
    assert shown.channel == "ft" and shown.measured is first.measured["ft"] and shown.simulated[0] == 3.0


@pytest.fixture(scope="module")
def solution():
    """The fit of a rig with a hardening spring to 4 s."""
    record = excited(RIG, "multisine", sensors=3, duration=4.0, period=4.0)
    return fit((case_from(record, RIG),), RIG.with_effect("nonlinear_spring"))[0]


def test_an_unknown_without_sensitivity_has_the_widest_interval_and_is_reported(monkeypatch, solution):
    """A bound of 2e4 beside priors of 0.01 was cut off as a singular direction: its doubt came out as 0."""
    names = [u.name for u in solution.problem.unknowns]
    i = names.index("nonlinear_spring.cubic")
    matrix = solution.jacobian.copy()
    matrix[:, i] = 0.0
    monkeypatch.setattr(confidence, "central_jacobian", lambda *_: matrix)
    doubt = confidence.confidence_of(replace(solution, jacobian=matrix))
    assert np.sqrt(doubt.covariance[i, i]) == pytest.approx(solution.problem.unknowns[i].reach, rel=1e-6)
    remarks = confidence.undetermined_remarks(solution.problem.unknowns, doubt)
    assert Remark("not_shown", ("nonlinear_spring.cubic",)) in remarks


def test_no_variance_of_indistinguishable_unknowns_is_negative(monkeypatch, solution):
    """Rounding left a variance below zero, and its root was a warning and no interval."""
    for seed in range(8):
        rng = np.random.default_rng(seed)
        matrix = 1e9 * np.outer(rng.normal(size=len(solution.residual)), rng.normal(size=len(solution.theta)))
        monkeypatch.setattr(confidence, "central_jacobian", lambda *_, matrix=matrix: matrix)
        doubt = confidence.confidence_of(replace(solution, jacobian=matrix))
        assert np.all(np.diag(doubt.covariance) > 0.0)


def test_values_of_which_only_a_combination_is_determined_are_not_and_nothing_is_singular():
    """Beside 1e28 the little that stands in for no information is lost: LinAlgError, told as a bug."""
    together = np.array([1e14, 1e14, 1.0])
    assert (shares_from_data(np.outer(together, together), np.ones(3)) < 1e-6).all()
    assert (shares_from_data(1e6 * np.eye(3), np.ones(3)) > 0.99).all()


def test_far_from_the_noise_a_value_is_determined_in_part_at_most():
    """Each was "yes" beside 9 801 times the noise."""
    sure = ParameterEstimate("spring.damping", 1.24, "N m s/rad", (1.1, 1.3), 0.2, 2.0, 1.0)
    assert sure.determined == "yes"
    assert replace(sure, beside_misfit=True).determined == "in part"


def test_the_angle_of_a_pendulum_is_an_angle():
    """-25374.51895 +- 0.00044 rad was one that had run around."""
    angle = Unknown("spring_end.gravity_angle", 0.0, "rad", -np.inf, np.inf, False, np.inf, 1.0)
    low, high = interval(angle, -25374.0, 1e3)
    assert abs(angle.outer(-25374.0)) <= np.pi and high - low == pytest.approx(2.0 * np.pi)
