"""The words of page and terminal, and the profiles of a residual, against known values."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from rich.console import Console

from rsea_ros.diagnosis.result import CauseParameter, Misfit, Reason, Rejected
from rsea_ros.diagnosis.settings import AcceptanceSettings, DiagnosisSettings
from rsea_ros.identification.result import Overlay
from rsea_ros.identification.settings import NoiseSettings
from rsea_ros.records.record import Fault
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.files import diagnosis_json
from rsea_ros.report.diagnosis.page import settings_section
from rsea_ros.report.diagnosis.terminal import terminal_lines
from rsea_ros.report.diagnosis.where import BINS, Profile, finding, profiles, where_figure
from rsea_ros.report.diagnosis.words import diagnosis_sentence


def terminal(diagnosis):
    """Return what a pipe gets."""
    console = Console(file=io.StringIO(), width=80)
    for line in terminal_lines(diagnosis):
        console.print(line, soft_wrap=True, highlight=False)
    return console.file.getvalue().splitlines()


def test_the_terminal_says_the_essence_in_about_ten_lines(diagnosed):
    lines = terminal(diagnosed.diagnosis)
    assert lines[0] == "Coulomb friction (3.00 N·m) explains the misfit; only noise is left"
    assert lines[1] == "rig         paper_high_impedance"
    assert lines[2].startswith("residual    F/T torque ")
    assert lines[3].startswith("cause       coulomb_friction: torque ")
    assert len(terminal_lines(diagnosed.diagnosis)) <= 13
    assert max(map(len, lines)) <= 100


def test_the_terminal_lists_faults_rivals_and_rejected_effects(diagnosed):
    d = diagnosed.diagnosis
    d = replace(
        d,
        causes=(replace(d.causes[0], confusable_with=("stribeck_friction",)),),
        rejected=(Rejected("backlash", 0.25, "explains_less", "coulomb_friction"),),
        faults=(Fault("frozen_samples", "ft", 0.05),),
        misfit=(Misfit("velocity", -0.1, 0.0, "rad/s", 48.0, "ft"),),
    )
    lines = terminal(d)
    assert "rejected    backlash: Coulomb friction explains more" in lines
    assert "unclear     Coulomb friction: these data do not distinguish it from Stribeck friction." in lines
    assert "data        frozen samples in F/T torque, 5.0 % of the samples" in lines
    assert "wrong at    speed −0.10 to 0 rad/s (48 times)" in lines


def test_the_terminal_lists_the_fitted_rivals_with_the_largest_gains(diagnosed):
    """Effects that were only screened came first, because their gain was not exactly zero."""
    screened = [Rejected(n, 0.9, "far_behind", is_fitted=False) for n in ("hard_stop", "ft_drift")]
    fitted = [Rejected(n, g, "explains_less", "coulomb_friction") for n, g in (("backlash", 0.25),
              ("command_delay", 0.1), ("nonlinear_spring", 0.8), ("ft_bias", 0.0))]  # fmt: skip
    lines = terminal(replace(diagnosed.diagnosis, rejected=(*screened, *fitted)))
    rejected = [line.split()[1].rstrip(":") for line in lines if line.startswith("rejected")]
    assert rejected == ["nonlinear_spring", "backlash", "command_delay"]


@pytest.mark.parametrize("reason", get_args(Reason))
def test_every_reason_has_words(reason):
    assert say.rejection(Rejected("backlash", 0.28, reason, "hard_stop"))


def test_a_gain_that_is_too_small_is_not_called_none():
    """A gain of 28 % stood beside "does not lower the residual of data that it was not fitted to"."""
    assert say.rejection(Rejected("backlash", 0.28, "too_small")).startswith("lowers the residual")


def test_a_channel_that_stays_above_the_noise_is_named(diagnosed):
    """The main channel fell to the noise and "the rest is open": no word said that it was the position's."""
    d = replace(
        diagnosed.diagnosis, verdict="partly_explained", channel="ft", at_noise_floor=False,
        noise_rms={"ft": 1.0, "position": 1.0}, residual_rms={"ft": 45.0, "position": 150.0},
        extended_residual_rms={"ft": 1.01, "position": 1.14},
    )  # fmt: skip
    assert "; the position residual stays at 1.14 times the noise." in diagnosis_sentence(d)
    assert terminal(d)[3].split() == ["position", "150", "→", "1.14", "times", "the", "noise"]
    open_too = replace(d, extended_residual_rms={"ft": 1.2, "position": 1.14})
    assert "to 1.20 times the noise; the rest stays unexplained." in diagnosis_sentence(open_too)
    assert not terminal(open_too)[3].startswith(" " * 12 + "position")


def test_json_sentence_and_page_name_the_same_channel(diagnosed):
    """The sentence spoke of the F/T torque where the headline spoke of the first cause's channel."""
    d = diagnosed.diagnosis
    assert d.channel == d.causes[0].channel
    assert diagnosis_json(d)["channel"] == d.channel and words.channel(d.channel) in diagnosis_sentence(d)
    elsewhere = terminal(replace(d, channel="position"))
    assert elsewhere[2].startswith("residual    position ")


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (CauseParameter(0.0040045, "rad", (0.0040015, 0.0040075)), ("4.0045", " ± 0.0030", "mrad")),
        (CauseParameter(2.5e-4, "s", (2.3e-4, 2.7e-4)), ("250", " ± 20", "µs")),
        (CauseParameter(3.0, "N m", (2.5, 3.5)), ("3.00", " ± 0.50", "N·m")),
        (CauseParameter(0.95, "1", (0.94, 0.96)), ("0.950", " ± 0.010", "")),
        (CauseParameter(3.0, "N m", (2.9, 4.4)), ("3.00", " −0.10/+1.4", "N·m")),
    ],
)
def test_small_angles_and_times_have_a_prefix(estimate, text):
    assert words.measured(estimate.value, *estimate.ci95, estimate.unit) == text


def test_an_experiment_is_described_with_its_units():
    run = {"kind": "chirp", "amplitude": 64.311, "unit": "N m", "low": 0.05, "high": 120.0, "duration": 12.0}
    assert say.excitation(run) == "chirp, amplitude 64.3 N·m, 0.05 to 120 Hz, 12 s"
    assert say.excitation({"kind": "steps", "periods": 3.0}) == "steps, periods 3"
    assert say.excitation({}) == ""


def test_a_number_without_unit_is_named(diagnosed):
    cause = replace(diagnosed.diagnosis.causes[0], name="ft_gain_error",
                    parameters={"gain": CauseParameter(1.05, "1", (1.04, 1.06))})  # fmt: skip
    assert say.cause_list([cause]) == "F/T gain error (gain 1.05)"


def laid_out(diagnosed, residual):
    """Return profiles of a residual that is a function of speed and time before, and zero after."""
    d, channels = diagnosed.diagnosis, diagnosed.record.channels
    t, speed = channels["ft"].t, channels["velocity"].y
    before = [Overlay(n, c.t, c.y, c.y) for n, c in channels.items() if n != "command"]
    shifted = channels["ft"].y - d.noise_rms["ft"] * residual(speed, t - t[0])
    wrong = [Overlay("ft", t, channels["ft"].y, shifted) if o.channel == "ft" else o for o in before]
    return {p.what: p for p in profiles(replace(d, before=tuple(wrong), after=tuple(before)), "ft")}


def test_a_residual_at_high_speed_is_located_at_high_speed(diagnosed):
    limit = float(np.quantile(diagnosed.record["velocity"].y, 1.0 - 1.0 / BINS))
    sentence = laid_out(diagnosed, lambda speed, t: np.where(speed > limit, 30.0, 2.0))
    assert set(sentence) == {"amplitude", "velocity", "angle", "time"}
    assert sentence["velocity"].before[-1] == pytest.approx(30.0, rel=0.05)
    assert sentence["velocity"].before[:-2] == pytest.approx(2.0)
    assert sentence["velocity"].after == pytest.approx(0.0)
    assert finding(list(sentence.values())).startswith("The residual depends most on speed: ")


def test_faulty_samples_count_for_nothing(diagnosed):
    d, t = diagnosed.diagnosis, diagnosed.record["ft"].t
    faulty = (t > 5.0) & (t < 6.0)
    diagnosis = replace(d, masked={"ft": faulty})
    masked = laid_out(replace(diagnosed, diagnosis=diagnosis), lambda speed, t: np.where(faulty, 1e3, 1.0))
    for profile in masked.values():
        assert np.nanmax(profile.before) == pytest.approx(1.0)


def test_a_uniform_residual_is_described_as_uniform(diagnosed):
    sentence = laid_out(diagnosed, lambda speed, t: 5.0 + 0.0 * t)
    assert finding(list(sentence.values())) == "The residual is the same at every load, speed or rotor angle"


def test_a_residual_of_zero_in_a_bin_leaves_the_axis_finite():
    resting = np.array([0.0, 2.0, 0.0])
    profile = Profile("time", "s", np.arange(4.0), resting, resting)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = where_figure([profile], changed=True)
    assert np.isfinite(figure.layout["yaxis"]["range"]).all()


def test_the_settings_are_in_json_and_page_and_a_changed_one_stands_out(diagnosed):
    changed = DiagnosisSettings(without=("ft_bias",), acceptance=AcceptanceSettings(fall=0.25))
    diagnosis = replace(diagnosed.diagnosis, settings=changed)
    written = diagnosis_json(diagnosis)["settings"]
    assert (written["acceptance.fall"], written["max_causes"]) == (0.25, 4)
    assert written["without"] == ["ft_bias"]
    section = settings_section(changed)
    assert "<b>0.25</b> (default 0.05)" in section and "Not tried: ft_bias." in section
    assert section.count("<b>") == 1


def test_the_numbers_of_the_noise_are_settings_in_json_and_page(diagnosed):
    changed = DiagnosisSettings(noise=NoiseSettings(above=1.1))
    written = diagnosis_json(replace(diagnosed.diagnosis, settings=changed))
    assert written["noise_numbers"].items() <= written["settings"].items()
    assert (written["settings"]["noise.above"], written["settings"]["noise.fewest"]) == (1.1, 1500)
    assert "<b>1.1</b> (default 1.04)" in settings_section(changed)
    assert "0, 0.1, 0.25" in settings_section(changed)


@pytest.mark.parametrize(("seconds", "shown"), [(1e5, ["drift"]), (12.0, ["drift", "time_constant"])])
def test_a_drift_that_never_settles_has_no_time_constant(diagnosed, seconds, shown):
    """A straight drift was given with a time constant of `100000 −100000/+490 s`."""
    parameters = {
        "drift": CauseParameter(0.5, "N m", (0.49, 0.51)),
        "time_constant": CauseParameter(seconds, "s", (0.0, seconds + 490.0)),
    }
    cause = replace(diagnosed.diagnosis.causes[0], name="ft_drift", parameters=parameters)
    assert list(num.sizes(cause)) == shown
    rows = terminal(replace(diagnosed.diagnosis, causes=(cause,)))
    (line,) = [row for row in rows if row.startswith("cause")]
    assert ("time constant" in line) == ("time_constant" in shown)
