"""Values that the data do not determine keep the whole doubt of their bounds."""

from dataclasses import replace

import numpy as np
import pytest
from runs import RIG, excited

from rsea_ros.identification import confidence
from rsea_ros.identification.confidence import interval
from rsea_ros.identification.fit import fit
from rsea_ros.identification.problem import case_from
from rsea_ros.identification.result import ParameterEstimate, Remark, shares_from_data
from rsea_ros.identification.unknowns import Unknown


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
