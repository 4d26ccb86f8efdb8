"""A mode above the end of a chirp, beside a delay: a fit that begins below it must still reach it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate, refit
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.step_fits import ScreenedEffect, StepFits
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.excitation import ExcitationSettings, chirp
from rsea_ros.identification.fit import add_effect
from rsea_ros.identification.solver import worker_pools
from rsea_ros.identification.unknowns import with_effect
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RATE = 280.0
MODE = {"frequency": 46.0, "damping_ratio": 0.11, "participation": 0.8}
BESIDE = {"frequency": 32.0, "damping_ratio": 0.3, "participation": -0.26}


@pytest.fixture(scope="module")
def record():
    rig = load_rig("sea_two_encoders").with_values({"rotor.reflected_damping": 60.0})
    for name, parameters in {
        "structural_resonance": MODE,
        "command_delay": {"delay": 6e-3},
    }.items():
        rig = with_effect(rig, name, parameters)
    asked = ExcitationSettings(rate=RATE, duration=30.0, amplitude=5.0, noise=0.0, low=0.1, high=40.0)
    command = chirp(asked)
    whole = synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=1)
    return replace(whole, channels={n: whole[n] for n in ("command", "ft", "deflection")})


def test_a_fit_of_a_mode_that_begins_below_it_reaches_it(record):
    rig, mode = load_rig("sea_two_encoders"), effect_named("structural_resonance")
    nominal = nominal_problem([check(record, rig)], rig)
    delayed = add_effect(nominal, np.array([u.inner(u.start) for u in nominal.unknowns]),
                         effect_named("command_delay"), {"delay": 9e-3})  # fmt: skip
    with worker_pools() as pools:
        setup = FitSetup(nominal.cases, DEFAULT, pools.run)
        current = refit(fit_candidate(setup, *delayed), setup)
        fits = StepFits(current, [mode], pools, DEFAULT, lambda what, share: None)
        problem, theta = add_effect(fits.on_pieces.problem, fits.on_pieces.theta, mode, BESIDE)
        (model,) = fits.fit_modes_again(fits.fit_all([ScreenedEffect(mode, problem, theta, 0.0)]))
    assert model.validation.ratio("ft") == pytest.approx(1.0, abs=0.03)
    assert model.solution.values["command_delay.delay"] == pytest.approx(6e-3, abs=1e-3)
    assert model.solution.values["structural_resonance.frequency"] == pytest.approx(46.0, abs=1.0)
