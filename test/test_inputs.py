"""Bad and unusual benches and bags: a result, or one line and status 2. The full gate is `bench inputs`."""

import json
import warnings

import numpy as np
import pytest

from bench.inputs.bags import bag_of, record_of
from rsea_ros.cli.main import main
from rsea_ros.diagnosis.initial_guess import RecordView, initial_guesses
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import IdentificationError, RigError
from rsea_ros.identification.identify import identify
from rsea_ros.identification.problem import case_from
from rsea_ros.model.extent import bound_values, check_extent
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import drive_of, synthesize
from rsea_ros.records.record import Channel, Record

BENCH = {
    "rig": "paper_high_impedance", "channels": ("ft", "position"), "sensors": "stated", "noise": True,
    "bench": "as stated", "rate": 280.0, "states": 1.0, "duration": 4.5, "command": "white_noise",
    "stamps": "even", "dead": "none", "loop": False, "epoch": 1_700_000_000_000_000_000,
}  # fmt: skip


def record(**changes: object) -> Record:
    case = {**BENCH, **changes}
    return record_of(case, load_rig(case["rig"]))


@pytest.fixture
def played(tmp_path, capsys):
    """Return a function that plays a verb on a bag: status, stdout, and the line on stderr."""

    def play(verb, *options, **changes):
        bag, rig = bag_of({**BENCH, **changes}, tmp_path)
        out = tmp_path / ("out.csv" if verb == "predict" else "out")
        where = [str(rig), str(bag)] if verb == "predict" else [str(bag), "--rig", str(rig)]
        status = main([verb, *where, "--out", str(out), *options])
        printed, said = capsys.readouterr()
        if status == 0 and verb != "predict":
            assert (out / "report.html").exists()
        assert status == 0 or (status == 2 and said.count("\n") == 1), said
        return status, printed, said

    return play


BUT_PLAY = " ".join(name for name in catalogue() if name not in ("backlash", "coulomb_friction"))
RESULTS = {
    "a misfitting spring rig without motor torque": (
        f"diagnose --without {BUT_PLAY}", {"bench": "misfit", "duration": 4.5}
    ),
    "channels without noise": ("identify", {"noise": False, "sensors": "zero"}),
    "a sample of 1e308": ("predict", {"dead": "1e308"}),
    "a sample of 1e308 in position and velocity": (
        "predict", {"dead": "1e308", "channels": ("position", "velocity")}
    ),
    "no value in position and velocity": (
        "predict", {"dead": "all 1e300", "channels": ("ft", "position", "velocity")}
    ),
    "too few samples to compare": ("predict", {"dead": "few"}),
    "a sensor of 1e-300": ("identify", {"channels": ("position", "velocity"), "sensors": "left out",
                                        "dead": "velocity zero"}),
}  # fmt: skip


@pytest.mark.parametrize("name", RESULTS)
def test_an_unusual_input_gives_a_result(played, name):
    (verb, *options), changes = RESULTS[name][0].split(), RESULTS[name][1]
    status, printed, said = played(verb, "--json", *options, **changes)
    assert status == 0, said
    json.loads(printed, parse_constant=pytest.fail)


def test_a_missing_value_does_not_change_the_initial_motion_and_the_angle():
    """With one NaN a record that begins in motion was taken to begin at rest, and the angle had no spline."""
    rig = load_rig("paper_high_impedance")
    moving = record(channels=("ft", "position", "velocity"), command="slow").between(1.5, 4.0)
    k = len(moving["position"]) // 2
    spoiled = moving.with_channels(
        **{n: Channel(moving[n].t, np.where(np.arange(len(moving[n])) == k, np.nan, moving[n].y))
           for n in ("position", "velocity")}
    )  # fmt: skip
    whole, holed = drive_of(moving, rig), drive_of(spoiled, rig)
    assert whole.initial == holed.initial != (0.0, 0.0)
    assert np.allclose(whole.angle, holed.angle, atol=0.01 * np.ptp(whole.angle))


REFUSALS = {
    "a zero command": ("identify", {"command": "zero"}, "the command stays at 0 N·m and nothing moves"),
    "a drive without a spring beyond all numbers": (
        "predict", {"rig": "bare_drive", "dead": "all 1e300"}, "position has 0 samples, expected at least 64"
    ),
    "a dead bench": ("identify", {"dead": "all still"}, "no sensor answers to the machine"),
    "too few samples": ("identify", {"dead": "few"}, "position or velocity with motion"),
    "a command of NaN": ("predict", {"dead": "command nan"}, "is nan N·m, expected a number"),
    "sensors of another day to a fit": ("identify", {"stamps": "apart"}, "stamped by the command's clock"),
    "no measurement": ("identify", {"channels": ()}, "record one, or name its topic with --topic"),
    "nothing to compare": ("predict", {"stamps": "apart"}, "expected one channel"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSALS)
def test_a_bad_input_is_refused_in_one_line(played, name):
    verb, changes, words = REFUSALS[name]
    status, printed, said = played(verb, **changes)
    assert (status, printed) == (2, "")
    assert words in said


def test_a_rig_without_noise_is_controlled(tmp_path):
    from rsea_ros.control.study import TrialResult, restlessness

    value = restlessness(load_rig("cycloidal"), design=None)
    assert np.isnan(value)
    assert TrialResult("held", value, "1", 1.1).met is None


def test_a_simulation_that_runs_away_is_refused():
    rig = load_rig("paper_high_impedance").with_effects(EffectSetting("ft_bias", {"bias": 1e300}))
    with pytest.raises(RigError, match=r"its simulation runs away, ft is 1e\+300 at sample 0"):
        synthesize(rig, Channel(np.arange(100) / 280.0, np.ones(100)))


def test_a_torque_limit_is_guessed_without_a_measured_motor_torque():
    case = case_from(record(), load_rig("paper_high_impedance"))
    seen = RecordView(case, load_rig("paper_high_impedance"), dict(case.measured))
    limits = [start["limit"] for start in initial_guesses(effect_named("torque_saturation"), seen)]
    assert len(limits) == 4 and min(limits) > 0.0


def test_a_channel_without_a_valid_sample_is_left_out():
    whole = record()
    late = Record({**whole.channels, "velocity": Channel(whole["ft"].t[:5], whole["ft"].y[:5])})
    assert set(case_from(late, load_rig("paper_high_impedance")).measured) == {"ft", "position"}


def test_numbers_beyond_any_measurement_count_as_missing():
    y = np.array([1.0, 1e31, -1e300, 1e-31, -5e-324, 0.0, np.inf])
    channel = bound_values(Record({"ft": Channel(np.arange(7.0), y)}))["ft"]
    assert np.array_equal(channel.y, [1.0, np.nan, np.nan, 0.0, 0.0, 0.0, np.nan], equal_nan=True)


def test_a_grid_over_a_pause_is_bounded_by_the_samples():
    t = np.concatenate([np.arange(1000) * 0.01, 400.0 + np.arange(1000) * 0.01])
    paused = Record({"command": Channel(t, np.zeros(2000)), "ft": Channel(t, np.zeros(2000))}, source="bag")
    with pytest.raises(
        IdentificationError, match=r"bag: 20 s of samples within 410 s, command pauses for 390"
    ):
        check_extent(paused, 0.0, 410.0)
    check_extent(paused, 0.0, 100.0)


def test_a_still_command_is_refused_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(IdentificationError, match="throughout, expected an excitation"):
            identify([record(command="constant")], load_rig("paper_high_impedance"))
