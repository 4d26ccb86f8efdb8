"""`rsea diagnose`: files, ten lines, statuses, and one line for a run that cannot be diagnosed."""

from __future__ import annotations

import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import rsea_ros.diagnosis.diagnose as engine
from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RATE, DURATION, FRICTION = 280.0, 16.0, 3.0
NAMES = ["diagnosis.json", "model.yaml", "overlay.mcap", "report.html"]


@pytest.fixture(scope="module")
def record():
    """A run of a bench with Coulomb friction."""
    command = excitation("chirp", ExcitationSettings(rate=RATE, duration=DURATION, seed=3))
    bench = load_rig("paper_high_impedance").with_effects(
        EffectSetting("coulomb_friction", {"torque": FRICTION})
    )
    made = synthesize(bench, Channel(np.arange(len(command)) / RATE, command), seed=5)
    return replace(made, epoch_ns=1_700_000_000_000_000_000)


@pytest.fixture
def bag(record, tmp_path):
    """A function that writes a record as a bag and returns its path."""

    def write(changed=record):
        write_record(changed, tmp_path / "run.mcap")
        return str(tmp_path / "run.mcap")

    return write


class Played(NamedTuple):
    """A call of the verb, and the diagnosis that it received."""

    status: int
    printed: str
    errors: str
    out: Path
    diagnosis: Diagnosis


@pytest.fixture(scope="module")
def played(record, tmp_path_factory):
    """Run the verb once with the real diagnosis, of few effects; test/report has them all on such a run."""
    others = catalogue().keys() - {"coulomb_friction", "stribeck_friction", "backlash", "command_delay"}
    place, told = tmp_path_factory.mktemp("played"), []
    write_record(record, place / "run.mcap")
    printed, errors, diagnose = StringIO(), StringIO(), engine.diagnose
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed), redirect_stderr(errors):
        patch.setattr(engine, "diagnose", lambda *a: told.append(diagnose(*a)) or told[0])
        words = ["--out", str(place / "out"), "--without", *sorted(others)]
        status = main(["diagnose", str(place / "run.mcap"), *words])
    return Played(status, printed.getvalue(), errors.getvalue(), place / "out", told[0])


@pytest.fixture
def known(played):
    """Return the diagnosis of the run."""
    return played.diagnosis


@pytest.fixture
def quick(known, monkeypatch):
    """Give the verb a diagnosis that is ready at once; return the arguments of its calls."""
    asked = []

    def answer(records, rig, holdout, tell, without):
        asked.append((records, rig, holdout, without))
        tell("round 1: backlash", 0.5)
        return known

    monkeypatch.setattr(engine, "diagnose", answer)
    return asked


def test_the_verb_finds_the_friction_and_leaves_four_files(played):
    assert (played.status, played.errors) == (0, "")
    lines = played.printed.splitlines()
    assert lines[0].startswith("Coulomb friction (3.00 N·m) explains the misfit")
    assert lines[-1] == f"report      {played.out / 'report.html'}"
    assert sorted(p.name for p in played.out.iterdir()) == NAMES
    model = load_rig(played.out / "model.yaml")
    assert model.effects[0].name == "coulomb_friction"
    assert model.effects[0].parameters["torque"] == pytest.approx(FRICTION, rel=0.02)


def test_json_prints_the_file_and_nothing_else(quick, bag, tmp_path, capsys):
    assert main(["diagnose", bag(), "--out", str(tmp_path / "out"), "--json"]) == 0
    printed, errors = capsys.readouterr()
    assert errors == ""
    assert printed == (tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8")
    assert json.loads(printed)["verdict"] == "explained"


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        (["explained"], 1),
        (["unexplained", "partly_explained"], 0),
        (["unexplained", "--fail-on", "explained"], 1),
    ],
)
def test_the_status_is_1_for_a_verdict_that_fail_on_names(quick, bag, tmp_path, verdicts, status):
    assert main(["diagnose", bag(), "--out", str(tmp_path / "out"), "--fail-on", *verdicts]) == status
    assert (tmp_path / "out" / "report.html").exists()


def test_bags_rig_and_holdout_reach_the_engine(quick, bag, record, tmp_path):
    run = bag()
    other, held_out = (str(tmp_path / name) for name in ("other.mcap", "held_out.mcap"))
    for path in (other, held_out):
        write_record(record, path)
    options = ["--holdout", held_out, "--rig", "pendulum", "--without", "backlash", "ft_bias"]
    main(["diagnose", run, other, *options, "--out", str(tmp_path / "out")])
    ((records, rig, holdout, settings),) = quick
    assert settings.without == ("backlash", "ft_bias")
    assert [r.source for r in records] == [run, other] and holdout.source == held_out
    assert rig.name == "pendulum"


def test_faults_of_the_data_are_findings_and_no_refusals(quick, bag, record, tmp_path):
    y = record["ft"].y.copy()
    y[100:120] = np.nan
    assert main(["diagnose", bag(record.with_channels(ft=Channel(record["ft"].t.copy(), y))),
                 "--out", str(tmp_path / "out")]) == 0  # fmt: skip
    assert np.isnan(quick[0][0][0]["ft"].y[100:120]).all()


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
def test_a_run_that_cannot_be_diagnosed_is_refused_in_one_line(bag, record, tmp_path, capsys, spoil, line):
    path = bag(spoil(record))
    assert main(["diagnose", path, "--out", str(tmp_path / "out")]) == 2
    printed, errors = capsys.readouterr()
    assert printed == "" and errors.count("\n") == 1
    assert errors.startswith(f"rsea diagnose: {path}: ") and line in errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "line"), [(None, "no such bag"), (b"", "empty file"), (b"hello" * 99, "no MCAP file")]
)
def test_a_file_that_is_not_a_bag_is_refused_in_one_line(tmp_path, capsys, content, line):
    path = tmp_path / "bad.mcap"
    if content is not None:
        path.write_bytes(content)
    assert main(["diagnose", str(path)]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith(f"rsea diagnose: {path}: {line}") and errors.count("\n") == 1


def test_a_file_in_place_of_the_directory_is_refused_before_any_work(quick, bag, capsys):
    path = bag()
    assert main(["diagnose", path, "--out", path]) == 2
    assert (
        capsys.readouterr().err
        == f"rsea diagnose: --out {path}: is a file, expected a directory or a new name\n"
    )
    assert quick == []


def test_an_unknown_effect_is_refused_in_one_line(quick, bag, tmp_path, capsys):
    assert main(["diagnose", bag(), "--out", str(tmp_path / "out"), "--without", "gremlins"]) == 2
    assert "effect 'gremlins': not in the catalogue" in capsys.readouterr().err.strip().splitlines()[-1]


def test_an_unknown_verdict_is_refused(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["diagnose", "run.mcap", "--fail-on", "bad"])
    assert leaving.value.code == 2
    assert "nothing_wrong" in capsys.readouterr().err
