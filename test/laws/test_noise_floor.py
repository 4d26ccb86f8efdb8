"""A law is looked for above the noise floor of a diagnosis, and nowhere else."""

from __future__ import annotations

import numpy as np
from independent.bench import drawn_bench, record_run
from scipy.signal import lfilter

from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.laws.choice import fitted_base
from rsea_ros.laws.learn import learn
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel
from rsea_ros.report.law.words import headline

RIG = load_rig("paper_high_impedance")


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
