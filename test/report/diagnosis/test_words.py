"""The words of page and terminal, and the profiles of a residual, against known values."""

import io
import warnings
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from rich.console import Console

from rsea_ros.diagnosis.result import (
    Alternative,
    Cause,
    CauseParameter,
    Experiment,
    ExperimentReason,
    Misfit,
    Reason,
    Rejected,
    Spectrum,
)
from rsea_ros.diagnosis.settings import AcceptanceSettings, DiagnosisSettings
from rsea_ros.identification.result import Overlay
from rsea_ros.records.record import Fault
from rsea_ros.report import words
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.figures import BINS, Profile, profile_finding, profiles, where_figure
from rsea_ros.report.diagnosis.page import diagnosis_json, diagnosis_report, settings_section
from rsea_ros.report.diagnosis.words import diagnosis_sentence, next_run, status_line, terminal_lines
from rsea_ros.report.figures.spectrum import finding as finding_of


def terminal(diagnosis):
    """Return what a pipe gets."""
    console = Console(file=io.StringIO(), width=80)
    for line in terminal_lines(diagnosis):
        console.print(line, soft_wrap=True, highlight=False)
    return console.file.getvalue().splitlines()


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
    assert profile_finding(list(sentence.values())).startswith("The residual depends most on speed: ")


def test_faulty_samples_count_for_nothing(diagnosed):
    d, t = diagnosed.diagnosis, diagnosed.record["ft"].t
    faulty = (t > 5.0) & (t < 6.0)
    diagnosis = replace(d, masked={"ft": faulty})
    masked = laid_out(replace(diagnosed, diagnosis=diagnosis), lambda speed, t: np.where(faulty, 1e3, 1.0))
    for profile in masked.values():
        assert np.nanmax(profile.before) == pytest.approx(1.0)


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


@pytest.mark.parametrize(("seconds", "shown"), [(1e5, ["drift"]), (12.0, ["drift", "time_constant"])])
def test_a_drift_that_never_settles_has_no_time_constant(diagnosed, seconds, shown):
    """A straight drift was given with a time constant of `100000 −100000/+490 s`."""
    parameters = {
        "drift": CauseParameter(0.5, "N m", (0.49, 0.51)),
        "time_constant": CauseParameter(seconds, "s", (0.0, seconds + 490.0)),
    }
    cause = replace(diagnosed.diagnosis.causes[0], name="ft_drift", parameters=parameters)
    assert list(say.sizes(cause)) == shown
    rows = terminal(replace(diagnosed.diagnosis, causes=(cause,)))
    (line,) = [row for row in rows if row.startswith("cause")]
    assert ("time constant" in line) == ("time_constant" in shown)


RUN = {"kind": "multisine"}
SAID = {
    "separates": (
        Experiment("separates", "backlash", ("hard_stop",), 3.21, excitation=RUN),
        "backlash and hard_stop do as well on these data; this run makes them differ by 3.2 times the noise",
    ),
    "inseparable": (
        Experiment("inseparable", "ft_gain_error", ("torque_constant_error", "ft_bias"), 0.042),
        "ft_gain_error and torque_constant_error and ft_bias make the same motion under every excitation "
        "tried within the limits of rig and driver (at most 0.04 times the noise apart): only a separate "
        "measurement distinguishes them, such as the spring stiffness by a known weight",
    ),
    "other_amplitude": (
        Experiment("other_amplitude", "backlash", ("hard_stop",)),
        "backlash and hard_stop do as well on these data; a run at another amplitude would show more",
    ),
    "amplitude_series": (
        Experiment("amplitude_series", amplitude=2.0, excitation=RUN),
        "nothing in the catalogue explains what is left: repeat at twice the amplitude with an odd "
        "multisine, whose empty lines show distortion apart from noise; what scales with the command is "
        "linear, what does not is friction-like",
    ),
}


@pytest.mark.parametrize("reason", get_args(ExperimentReason))
def test_every_reason_has_a_sentence(reason):
    experiment, sentence = SAID[reason]
    assert next_run(experiment) == sentence


DELAY = Cause(
    "command_delay",
    {"delay": CauseParameter(9.1e-3, "s", (8.4e-3, 9.8e-3))},
    0.4,
    0.4,
    (0.3, 0.5),
    (2.0, 1.2),
    status="leading",
    probability=0.87,
)
GAIN = replace(
    DELAY,
    name="ft_gain_error",
    parameters={"gain": CauseParameter(0.891, "1", (0.886, 0.896))},
    status="one_of",
    probability=0.55,
)
CONSTANT = Alternative(
    "torque_constant_error",
    "ft_gain_error",
    {"gain": CauseParameter(1.12, "1", (1.11, 1.13))},
    0.39,
    (0.3, 0.5),
    "ft",
    0.4,
)


def test_one_of_names_its_rival_with_its_size():
    assert status_line(GAIN, (CONSTANT,)) == (
        "one of: ft_gain_error 0.891 [0.886, 0.896], probability 0.55 or "
        "torque_constant_error 1.12 [1.11, 1.13], probability 0.40; these data do not distinguish them"
    )
    assert status_line(DELAY, (CONSTANT,)) == status_line(DELAY)


def test_no_sentence_says_more_than_its_interval(diagnosed):
    """"It certainly helps" stood beside -154 % [-429, 42], "39.0" above 40 +- 120, and +-10^14 %."""
    vague = {"delay": CauseParameter(9.1e-3, "s", (-0.1, 0.12))}
    unsure = replace(DELAY, parameters=vague, gain_holdout=-1.54, gain_holdout_ci95=(-1e12, 0.42))
    assert "certainly" not in status_line(unsure)
    assert say.cause_list([unsure]) == "command delay (size open)"
    assert say.percent_range(unsure.gain_holdout_ci95) == "< −100 to 42.0 %"
    worse = {n: 1.1 * v for n, v in diagnosed.diagnosis.residual_rms.items()}
    d = replace(
        diagnosed.diagnosis, verdict="partly_explained", causes=(DELAY,), extended_residual_rms=worse,
        at_noise_floor=False,
    )  # fmt: skip
    assert "falls" not in diagnosis_sentence(d)
    assert "explains no part of the misfit" in diagnosis_sentence(d)
    assert "rises from" in say.evidence(replace(DELAY, times_noise=(1.91, 2.01)))
    hz = np.geomspace(1.0, 100.0, 200)
    hump = 1.0 + 2.2 * np.exp(-((hz - 29.0) ** 2))
    d = replace(d, verdict="explained", spectra=(Spectrum(d.channel, hz, 3.0 * hump, hump, 1.0),))
    assert "little more than noise is left, at most 3.0 times at 29 Hz" in say.headline(d)
    white = finding_of(hz, np.full(200, 1.3), 1.0, "F/T torque")
    assert white.startswith("F/T torque: the residual lies above the noise floor, at most 1.3 times")
    assert (words.probability(0.99996), words.probability(0.93)) == ("> 0.999", "0.930")


def test_file_and_page_carry_status_probability_and_alternatives(diagnosed):
    assert diagnosed.diagnosis.causes[0].status == "confirmed"
    doubted = replace(
        diagnosed.diagnosis, verdict="partly_explained", causes=(GAIN,), alternatives=(CONSTANT,)
    )
    document = diagnosis_json(doubted)
    (cause,), (other,) = document["causes"], document["alternatives"]
    assert (cause["status"], cause["probability"]) == ("one_of", 0.55)
    assert (other["name"], other["instead_of"], other["probability"]) == (
        "torque_constant_error",
        "ft_gain_error",
        0.4,
    )
    assert other["parameters"]["gain"]["ci95"] == [1.11, 1.13]
    assert other["gain"]["holdout"] == 0.39
    assert "One of: F/T gain error 0.891" in diagnosis_report(doubted)
