"""Which data count how much: a held-out record or test blocks, and each of several runs by itself."""

from dataclasses import replace

import pytest
from runs import RIG, excited, only

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate, refit, with_noise_reestimated
from rsea_ros.diagnosis.diagnose import diagnose, nominal_problem
from rsea_ros.diagnosis.evaluation import HeldOut, fitted_noise
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.unknowns import start_vector


def record_of(stiffer=1.0, seed=1, channels=None):
    """Return a short record of the rig with its stiffness times a factor. channels: all by default."""
    bench = RIG.with_values({"spring.stiffness": stiffer * RIG["spring.stiffness"]})
    record = excited(bench, "chirp", sensors=seed, duration=8.0)
    return record if channels is None else only(record, *channels)


def checked_record(*args, **more):
    return check(record_of(*args, **more), RIG)


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


def test_a_channel_that_no_fitted_record_has_is_not_tested():
    """A held-out run with a velocity, beside one without, ended in a traceback."""
    nominal = nominal_problem([checked_record(channels=("ft", "position"))], RIG)
    held_out = HeldOut(nominal.cases, RIG, checked_record(seed=2), DEFAULT)
    tested = held_out.score(nominal, start_vector(nominal.unknowns))
    assert set(tested.sums) == {"ft", "position"}
    assert tested.ratio("position") == pytest.approx(1.0, abs=0.1)


def test_the_noise_of_a_channel_is_that_of_the_first_record_with_it():
    records = [checked_record(channels=("ft",)), checked_record(channels=("ft", "velocity"), seed=2)]
    cases = nominal_problem(records, RIG).cases
    noise = fitted_noise(cases)
    assert noise == {"ft": cases[0].noise["ft"], "velocity": cases[1].noise["velocity"]}


def test_a_held_out_record_without_a_fitted_channel_is_refused():
    fitted, other = record_of(channels=("ft",)), record_of(channels=("position",), seed=2)
    with pytest.raises(IdentificationError, match=r"has only position; expected one of .* fitted to: ft$"):
        diagnose([fitted], RIG, other)


def error_of_stiffness(model, setup, unit):
    """Fit again as often as causes would be added; return the relative error of the spring's stiffness."""
    for _ in range(4):
        model = refit(replace(model, validation=unit(model.validation)), setup)
    return abs(model.solution.values["spring.stiffness"] / RIG["spring.stiffness"] - 1.0)


def test_a_run_with_play_hardly_spoils_the_values_that_another_shows():
    asked = {"duration": 24.0, "noise": 0.0, "low": 0.2, "high": 30.0}
    sound = excited(RIG, "chirp", sensors=1, amplitude=10.0, **asked)
    worn = excited(RIG.with_effect("backlash", gap=4e-3), "chirp", sensors=11, amplitude=8.0, **asked)
    nominal = nominal_problem([check(r, RIG) for r in (sound, worn)], RIG)
    setup = FitSetup(nominal.cases, DEFAULT)
    model = with_noise_reestimated(fit_candidate(setup, nominal))
    in_units_of_both = error_of_stiffness(model, setup, lambda score: replace(score, run=None))
    in_units_of_each = error_of_stiffness(model, setup, lambda score: score)
    assert in_units_of_both > 0.05
    assert in_units_of_each < 0.005
