"""The intervals of a fit beside a named cause hold the truth of the second bench."""

from __future__ import annotations

import numpy as np
from independent.bench import drawn_bench, record_run
from independent.hidden import hide
from independent.severities import drawn_parameters

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.confidence import confidence_of
from rsea_ros.identification.fit import add_effect, unknowns_of
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import MEASURED

RIG = load_rig("paper_high_impedance")
BARE = RIG.with_values({"chassis.inertia": 0.0})
CASES = [(RIG, (1, 2)), (BARE, (1,))]


def z_scores(effect: str, rig, seed: int) -> dict[str, float]:
    """Return (estimate - truth) / sigma of every value, the effect's included, after a fit from the truth."""
    rng = np.random.default_rng(seed)
    parameters, bench = drawn_parameters(effect, "medium", rng), drawn_bench(rng)
    record = record_run(hide(bench, effect, parameters), seed, duration=16.0)
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
