"""The second bench moves as the model does with every effect, and intervals hold its truth."""

import functools

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import (
    CATALOGUE,
    OFF_CATALOGUE,
    hide,
    hide_off_catalogue,
)
from independent.plant import Bench, Plant
from independent.severities import drawn_parameters
from runs import RIG

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.fit import add_effect, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import MEASURED

NOISE = {"ft": 0.03, "position": 3.7e-6, "velocity": 2.1e-4, "motor_torque": 0.052}
NOISY = ("ft_noise", "position_quantum", "velocity_noise", "velocity_quantum", "motor_noise", "motor_quantum")
QUIET = dict.fromkeys(NOISY, 0.0)


def rms(y):
    """Return the root of the mean square after 0.3 s."""
    return float(np.sqrt(np.mean(y[84:] ** 2)))


def test_a_seed_determines_the_record():
    first, again, other = (record_run(Bench(), seed, duration=2.0) for seed in (1, 1, 2))
    for name in first.channels:
        np.testing.assert_array_equal(first[name].y, again[name].y)
        assert not np.array_equal(first[name].y, other[name].y)


def test_benches_differ_in_their_values_and_not_by_an_effect():
    plants = [drawn_bench(np.random.default_rng(seed)).plant for seed in range(200)]
    for name, spread in (("j_m", 0.15), ("b_m", 0.10), ("k_s", 0.03)):
        ratio = np.array([getattr(p, name) for p in plants]) / getattr(Plant(), name)
        assert 0.9 * spread < np.max(np.abs(ratio - 1.0)) <= spread


@pytest.mark.parametrize("effect", OFF_CATALOGUE)
def test_an_effect_outside_the_catalogue_shows(effect):
    quiet, nominal = (
        record_run(b.with_values(**QUIET), 3, duration=3.0)
        for b in (hide_off_catalogue(Bench(), effect), Bench())
    )
    assert max(rms(quiet[n].y - nominal[n].y) / noise for n, noise in NOISE.items()) > 2.0


OF_THE_MODEL = {
    "base_compliance": {"damping_ratio": Bench().plant.base_zeta},
    "mains_interference": {"phase": 0.0},
}
"""Parameters that the model has and the contract doesn't name."""


@functools.cache
def quiet_run(bench):
    return record_run(bench.with_values(**QUIET, hum_phase=0.0), 5, duration=4.0)


@pytest.mark.parametrize("effect", [None, "free housing", *CATALOGUE])
def test_both_implementations_agree(effect):
    """Within 6 % of the effect's own change, or half of the sensor's noise, RMS, after 0.3 s."""
    rig, bench = RIG, Bench()
    if effect == "free housing":
        rig, bench = load_rig("paper_moving_output"), Bench().with_values(housing_free=1.0)
    elif effect:
        parameters = drawn_parameters(effect, "medium", np.random.default_rng(3))
        bench = hide(bench, effect, parameters)
        rig = RIG.with_effect(effect, **parameters, **OF_THE_MODEL.get(effect, {}))
    hidden, plain = quiet_run(bench), quiet_run(Bench())
    for name, y in simulate(rig, hidden).items():
        change = 0.06 * rms(plain[name].y - hidden[name].y) if effect in CATALOGUE else 0.0
        assert rms(y - hidden[name].y) <= max(change, 0.5 * NOISE[name]), name


BARE = RIG.with_values({"chassis.inertia": 0.0})
CASES = [(RIG, (1, 2)), (BARE, (1,))]


def z_scores(effect, rig, seed):
    """Return (estimate - truth) / sigma of every value, the effect's included, after a fit from the truth."""
    rng = np.random.default_rng(seed)
    parameters, bench = drawn_parameters(effect, "medium", rng), drawn_bench(rng)
    record = record_run(hide(bench, effect, parameters), seed, duration=8.0)
    case, p = case_from(record, rig), bench.plant
    nominal = Problem((case,), rig, unknowns_of(rig, (case,)), MEASURED)
    start = start_vector(nominal.unknowns)
    solution = solve(*add_effect(nominal, start, effect_named(effect), parameters), iterations=40, gain=1e-8)
    rotor = p.j_m + p.j_sc * (rig["chassis.inertia"] == 0.0)
    truth = {
        "rotor.reflected_inertia": rotor,
        "rotor.reflected_damping": p.b_m,
        "spring.stiffness": p.k_s,
        "spring.damping": p.b_s,
        "gear_compliance.chassis_share": p.j_sc / rotor,
        **{f"{effect}.{name}": value for name, value in parameters.items()},
    }
    sd = np.sqrt(np.diag(confidence_of(solution).covariance))
    unknowns = zip(solution.problem.unknowns, solution.theta, sd, strict=True)
    return {u.name: (t - u.inner(truth[u.name])) / s for u, t, s in unknowns if u.name in truth}


def test_intervals_hold_the_truth_of_a_gear_that_gives():
    """The values of a record share few directions, so the RMS is that over all records."""
    scores = [z_scores("gear_compliance", rig, seed) for rig, seeds in CASES for seed in seeds]
    z = np.concatenate([list(s.values()) for s in scores])
    assert np.abs(z).max() < 4.0, scores
    assert np.sqrt(np.mean(z**2)) < 1.6, scores
