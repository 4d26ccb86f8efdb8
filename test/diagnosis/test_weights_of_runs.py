"""Two runs in one fit: the one that the model describes decides, not the one that it misses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate, refit, with_noise_reestimated
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.excitation import ExcitationSettings, chirp
from rsea_ros.identification.unknowns import with_effect
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RATE = 280.0
RIG = load_rig("paper_high_impedance")
GAP = {"gap": 4e-3}


def record(amplitude, seed, **effects):
    """A chirp on the rig with some effects that its model lacks."""
    asked = ExcitationSettings(rate=RATE, duration=24.0, amplitude=amplitude, noise=0.0, low=0.2, high=30.0)
    command, rig = chirp(asked), RIG
    for name, parameters in effects.items():
        rig = with_effect(rig, name, parameters)
    return synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=seed)


def error_of_stiffness(model, setup, unit):
    """Fit again as often as causes would be added; return the relative error of the spring's stiffness."""
    for _ in range(4):
        model = refit(replace(model, validation=unit(model.validation)), setup)
    return abs(model.solution.values["spring.stiffness"] / RIG["spring.stiffness"] - 1.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_run_with_play_hardly_spoils_the_values_that_another_shows(seed):
    records = [record(10.0, seed), record(8.0, seed + 10, backlash=GAP)]
    nominal = nominal_problem([check(r, RIG) for r in records], RIG)
    setup = FitSetup(nominal.cases, DEFAULT)
    model = with_noise_reestimated(fit_candidate(setup, nominal))
    in_units_of_both = error_of_stiffness(model, setup, lambda score: replace(score, run=None))
    in_units_of_each = error_of_stiffness(model, setup, lambda score: score)
    assert in_units_of_both > 0.05
    assert in_units_of_each < 0.005
