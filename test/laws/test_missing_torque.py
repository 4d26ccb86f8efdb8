"""Input estimation within the stated doubt; a law is looked for above the noise floor and nowhere else."""

from dataclasses import replace

import numpy as np
from effect_bench import RIG, command
from independent.bench import drawn_bench, record_run
from scipy.signal import lfilter

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.unknowns import vector_of
from rsea_ros.laws.choice import fitted_base
from rsea_ros.laws.learn import learn
from rsea_ros.laws.sparse_regression import SELECTION, fold_sums, gram_of
from rsea_ros.laws.variables import case_model, rows_of
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel
from rsea_ros.report.law import headline


def problem_with(extra):
    """Return the fit of a record in which a torque acted beside the logged command."""
    logged = command(280.0, 10.0)
    record = synthesize(RIG, Channel(logged.t, logged.y + extra), seed=2)
    record = record.with_channels(command=logged, motor_torque=Channel(logged.t + logged.t[1], logged.y))
    problem = nominal_problem([check(record, RIG)], RIG)
    return problem, vector_of(problem.unknowns, RIG)


def bump(t):
    return 1.5 * np.sin(2.0 * np.pi * 1.3 * t) * (np.sin(2.0 * np.pi * 0.2 * t) > 0.0)


def test_a_hidden_torque_is_reconstructed_within_its_doubt():
    t = np.arange(2800) / 280.0
    problem, theta = problem_with(bump(t))
    case = problem.cases[0]
    missing = case_model(problem, theta, case, problem.outputs(theta)[0]).missing
    inside = (missing.t > 0.5) & (missing.t < 9.5)
    error = (missing.torque - np.interp(missing.t + 0.5 / 280.0, t, bump(t)))[inside]
    assert np.std(error) < 0.35
    assert 0.5 < np.std(error) / missing.sd < 2.0


def test_a_value_of_the_rig_that_the_data_do_not_show_stays_at_its_prior():
    problem, theta = problem_with(bump(np.arange(2800) / 280.0))
    rows = rows_of(problem, theta)
    unseen = rows.nominal.copy()
    unseen[:, 0] = 0.0
    gram = gram_of(replace(rows, nominal=unseen), [np.sin(np.arange(len(rows.residual)))])
    column = np.array([len(gram.prior)])
    assert gram.fit(column, SELECTION)[0] == 0.0
    assert np.isfinite(fold_sums(gram, np.ones(len(rows.channels))).loss(np.append(gram.nominal, column)))


def test_held_out_losses_are_those_of_fits_by_hand():
    t = np.arange(2800) / 280.0
    problem, theta = problem_with(bump(t))
    rows = rows_of(problem, theta)
    rng = np.random.default_rng(1)
    columns = [rng.standard_normal(len(rows.residual)) for _ in range(3)]
    gram = gram_of(rows, columns)
    which = np.array([len(gram.prior), len(gram.prior) + 2])
    beta = gram.fit(which, SELECTION)
    x = np.column_stack([rows.nominal, columns[0], columns[2]]) / gram.scale[[*gram.nominal, *which]]
    left = rows.residual - x @ beta
    by_hand = np.bincount(rows.group, left**2, 32)
    np.testing.assert_allclose(gram.loss(which, beta).sum(axis=1), by_hand, rtol=1e-3, atol=1e-2)



def coloured_record():
    """Return a record of a bench without any effect whose F/T sensor has coloured noise (AR 0.9)."""
    record = record_run(drawn_bench(np.random.default_rng(2)), 4, duration=12.0)
    ft = record["ft"]
    noise = 0.03 * lfilter([1.0], [1.0, -0.9], np.random.default_rng(7).standard_normal(len(ft)))
    return record.with_channels(ft=Channel(ft.t, ft.y + noise))


def test_a_residual_that_a_diagnosis_takes_for_noise_needs_no_law():
    """The smaller of two estimates of the noise counted: 2.5 times the noise, where diagnose saw none."""
    record = coloured_record()
    result = learn([record], RIG)
    assert result.at_floor and result.laws == ()
    assert headline(result) == "No law is needed: the model is at the noise floor"
    base = fitted_base([record], RIG)
    (case,), (outputs,) = base.cases, base.outputs
    assert reestimate_noise(case, outputs, RIG["gear.ratio"]).noise["ft"] > 2.0 * RIG.sensors["ft"].noise
