"""`rsea check`: a table, JSON, statuses, windows; and the same checks before identify and diagnose."""

import json

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.checks.carried import with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel


@pytest.fixture(scope="module")
def good():
    return record_run(drawn_bench(np.random.default_rng(2)), 4, duration=8.0)


@pytest.fixture(scope="module")
def bag(good, tmp_path_factory):
    """Return a function that gives the path of the good record, or of one with other channels."""
    sound = tmp_path_factory.mktemp("good") / "good.mcap"
    write_record(good, sound)

    def write(**channels):
        if not channels:
            return str(sound)
        path = tmp_path_factory.mktemp("changed") / "changed.mcap"
        write_record(good.with_channels(**channels), path)
        return str(path)

    return write


def dead(record):
    return Channel(record["ft"].t, np.zeros(len(record["ft"])))


def turn_ft(record):
    return Channel(record["ft"].t, -record["ft"].y)


def test_the_suggested_axis_corrects_the_bag(bag, good, capsys):
    assert main(["check", bag(ft=turn_ft(good)), "--axis=-torque.z", "--fail-on", "red"]) == 0


def test_the_page_says_first_what_to_put_right(bag, good, tmp_path, capsys):
    words = ["check", bag(ft=turn_ft(good)), "--rig", "paper_high_impedance", "--out", str(tmp_path / "out")]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<h1>Put right before a fit: sign of the F/T torque</h1>" in page
    assert page.index("<td>red") < page.index("<div class=\"figure\"")
    written = json.loads((tmp_path / "out" / "check.json").read_text())
    assert {key: written[key] for key in told} == told
    assert main(words) == 2 and "exists" in capsys.readouterr().err


def repeated(record):
    """Stamps that repeat: the record that is judged has fewer samples."""
    t = record["ft"].t.copy()
    t[500:560:7] = t[499:559:7]
    return Channel(t, record["ft"].y)


def held(record):
    """A sensor that is slower than the log."""
    return Channel(record["ft"].t, np.repeat(record["ft"].y[::4], 4)[: len(record["ft"])])


@pytest.mark.parametrize("change", [repeated, held])
def test_the_page_shows_the_repaired_record(bag, good, tmp_path, change):
    """It ended with a request to report a bug."""
    words = ["check", bag(ft=change(good)), "--rig", "paper_high_impedance", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert "Every channel over time" in (tmp_path / "out" / "report.html").read_text()


def test_for_a_dead_axis_the_one_that_follows_the_command_is_suggested(bag, capsys):
    assert main(["check", bag(), "--axis", "torque.x", "--fail-on", "red"]) == 1
    assert "--axis torque.z" in capsys.readouterr().out


def silent_at_last(record):
    """Zero from 7 s on."""
    return Channel(record["ft"].t, np.where(record["ft"].t < 7.0, record["ft"].y, 0.0))


@pytest.mark.parametrize(("options", "status"), [("--from 2 --to 7", 0), ("--window=2:7", 0), ("", 1)])
def test_a_window_leaves_out_what_lies_outside(bag, good, options, status):
    assert main(["check", bag(ft=silent_at_last(good)), *options.split(), "--fail-on", "amber"]) == status


@pytest.mark.parametrize("verb", [["check"], ["predict", "paper_high_impedance"]])
@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--window", "90:99"], "no sample"),
        (["--window", "5"], "expected A:B"),
        (["--from", "3", "--to", "2"], "a beginning before its end"),
        (["--from", "nan"], "a beginning before its end"),
    ],
)
def test_every_verb_refuses_a_senseless_window_in_one_line(bag, verb, options, what, capsys):
    assert main([*verb, bag(), *options]) == 2
    errors = capsys.readouterr().err
    assert what in errors and errors.count("\n") == 1


def test_identify_says_first_what_is_wrong_and_leaves_a_dead_channel_out(bag, good, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["identify", bag(ft=dead(good)), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "F/T torque measures nothing; the model fits the rest: " in printed
    assert "dead channel in F/T torque" in printed and "next: " not in printed
    said = json.loads((out / "identification.json").read_text(encoding="utf-8"))
    assert {(f["kind"], f["channel"]) for f in said["data"]["faults"]} == {("dead_channel", "ft")}
    assert "ft" not in said["residual_rms"]
    assert (said["verdict"], said["next"]) == ("misfit", None)


def test_identify_questions_the_rig(bag, tmp_path, capsys):
    words = ["--rig", "prototype_knee", "--to", "4", "--out", str(tmp_path / "out")]
    assert main(["identify", bag(), *words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "compared with rig prototype_knee:"
    assert "is this the right rig?" in " ".join(" ".join(lines[1:4]).split())


SENTENCE = "judged by its torque, a rig without a spring makes no use of velocity, ft"


@pytest.fixture(scope="module")
def run():
    record = rsea.simulate("bare_drive", 15.0 * np.random.default_rng(4).standard_normal(1680), 280.0, seed=4)
    return record.with_channels(ft=Channel(record["command"].t, np.sin(record["command"].t)))


def test_the_check_and_the_record_of_a_fit_say_it(run):
    rig = load_rig("bare_drive")
    assert SENTENCE in check_record(run, rig).of("topics")[0].detail
    assert with_check_faults(run, rig, masks=False).notes == (SENTENCE,)
    assert check_record(run, load_rig("paper_high_impedance")).of("topics")[0].detail.count("no use") == 0


def test_a_torque_beside_the_targets_of_a_pd_loop_is_told(run):
    beside = run.with_channels(reference=run["position"])
    said = check_record(beside, load_rig("pd_joint")).of("topics")[0].detail
    assert "a pd loop makes no use of command beside reference" in said


def test_identify_says_it_once(run, tmp_path, capsys):
    write_record(run, tmp_path / "bag")
    words = ["identify", str(tmp_path / "bag"), "--rig", "bare_drive", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    assert capsys.readouterr().out.count(SENTENCE) == 1
