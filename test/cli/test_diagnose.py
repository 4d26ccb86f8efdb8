"""`rsea diagnose`: its options, its status, and one line for a run that cannot be diagnosed."""

from dataclasses import replace

import numpy as np
import pytest
from writing_verbs import Result, prepare

import rsea_ros.diagnosis.diagnose as engine
from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.design import spring_design
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RATE, DURATION = 280.0, 16.0


@pytest.fixture(scope="module")
def record():
    command = excitation("chirp", ExcitationSettings(rate=RATE, duration=DURATION, seed=3))
    bench = load_rig("paper_high_impedance")
    made = synthesize(bench, Channel(np.arange(len(command)) / RATE, command), seed=5)
    return replace(made, epoch_ns=1_700_000_000_000_000_000)


@pytest.fixture
def quick(record, tmp_path, monkeypatch):
    """Give the verb a diagnosis that is ready at once; return the arguments of its calls."""
    prepare(record, tmp_path, monkeypatch)
    asked = []

    def answer(records, rig, holdout, tell, without):
        asked.append((records, rig, holdout, without))
        return Result(verdict="explained")

    monkeypatch.setattr(engine, "diagnose", answer)
    return asked


@pytest.mark.parametrize(
    ("verdicts", "status"), [(["explained"], 1), (["unexplained", "partly_explained"], 0)]
)
def test_the_status_is_1_for_a_verdict_that_fail_on_names(quick, verdicts, status):
    assert main(["diagnose", "run.mcap", "--json", "--out", "out", "--fail-on", *verdicts]) == status


@pytest.mark.parametrize(("feasible", "status"), [(False, 1), (True, 0)])
def test_the_status_of_a_design_is_1_where_it_is_not_met(quick, monkeypatch, feasible, status):
    monkeypatch.setattr(spring_design, "spring_design", lambda *asked: Result(feasible=feasible))
    assert main(["design", "--json", "--out", "out", "--fail-on", "unmet"]) == status


def test_bags_rig_and_holdout_reach_the_engine(quick, record):
    for path in ("other.mcap", "held_out.mcap"):
        write_record(record, path)
    options = ["--holdout", "held_out.mcap", "--rig", "pendulum", "--without", "backlash", "ft_bias"]
    assert main(["diagnose", "run.mcap", "other.mcap", *options, "--json", "--out", "out"]) == 0
    ((records, rig, holdout, settings),) = quick
    assert settings.without == ("backlash", "ft_bias")
    assert [r.source for r in records] == ["run.mcap", "other.mcap"] and holdout.source == "held_out.mcap"
    assert rig.name == "pendulum"


def test_a_file_in_place_of_the_directory_is_refused_before_any_work(quick, refused):
    line = "rsea diagnose: --out run.mcap: is a file, expected a directory or a new name\n"
    assert refused("diagnose", "run.mcap", "--out", "run.mcap") == line
    assert quick == []


def without_command(record):
    return replace(record, channels={n: c for n, c in record.channels.items() if n != "command"})


def backwards(record):
    return record.with_channels(ft=Channel(record["ft"].t[::-1].copy(), record["ft"].y))


def still(record):
    held = {n: Channel(c.t, 0.0 * c.y) for n, c in record.channels.items() if n != "command"}
    return record.with_channels(**held)


@pytest.mark.parametrize(
    ("spoil", "line"),
    [
        (without_command, "no command, expected the torques that drove the run beside position, velocity"),
        (lambda r: r.between(0.0, 3.0), "3 s of commands, expected 4 s or more"),
        (
            lambda r: Record({"command": r["command"]}, "", r.epoch_ns),
            "no measurement beside the command, expected one",
        ),
        (backwards, "ft: 4480 samples, expected rising stamps"),
        (still, "every measured channel holds one value, expected motion"),
    ],
)
def test_a_run_that_cannot_be_diagnosed_is_refused_in_one_line(record, tmp_path, refused, spoil, line):
    path, out = tmp_path / "run.mcap", tmp_path / "out"
    write_record(spoil(record), path)
    said = refused("diagnose", path, "--out", out)
    assert said.startswith(f"rsea diagnose: {path}: ") and line in said
    assert not out.exists()
