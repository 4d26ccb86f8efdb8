"""Models are tested on the held-out record where one is given, and on the test blocks otherwise."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.evaluation import HeldOut
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.signals import Channel

RIG = load_rig("paper_high_impedance")


def checked_record(stiffer=1.0, seed=1):
    """Return a short record of the rig with its stiffness times a factor."""
    bench = RIG.with_values({"spring.stiffness": stiffer * RIG["spring.stiffness"]})
    u = excitation("chirp", ExcitationSettings(rate=280.0, duration=8.0))
    return check(synthesize(bench, Channel(np.arange(len(u)) / 280.0, u), seed=seed), RIG)


def test_a_held_out_record_takes_the_place_of_the_test_blocks():
    nominal = nominal_problem([checked_record()], RIG)
    theta = start_vector(nominal.unknowns)
    on_blocks = HeldOut(nominal.cases, RIG, None, DEFAULT).score(nominal, theta)
    alike = HeldOut(nominal.cases, RIG, checked_record(seed=2), DEFAULT).score(nominal, theta)
    stiffer = HeldOut(nominal.cases, RIG, checked_record(1.05, seed=2), DEFAULT).score(nominal, theta)
    assert on_blocks.ratio("position") == pytest.approx(1.0, abs=0.1)
    assert alike.ratio("position") == pytest.approx(1.0, abs=0.1)
    assert stiffer.ratio("position") > 5.0
    assert on_blocks.counts["ft"].sum() < 0.3 * alike.counts["ft"].sum()


def test_a_simulation_of_the_cases_is_reused_for_their_test_blocks():
    nominal = nominal_problem([checked_record()], RIG)
    theta = start_vector(nominal.unknowns)
    held_out = HeldOut(nominal.cases, RIG, None, DEFAULT)
    again = held_out.score(nominal, theta, nominal.outputs(theta))
    assert again.sums["ft"] == pytest.approx(held_out.score(nominal, theta).sums["ft"])
