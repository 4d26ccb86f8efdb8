"""The cause-naming benchmark from end to end: make, run, score, and every way to get a file wrong."""

from __future__ import annotations

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from rsea_extras.benchmark import scoring
from rsea_extras.benchmark.dataset import Answer, read_dataset
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig

RECORDS = 4


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the folder that holds a data set `set` and its truth."""
    folder = tmp_path_factory.mktemp("benchmark")
    assert main(["benchmark", "make", str(folder / "set"), "--records", str(RECORDS), "--duration", "5"]) == 0
    return folder


@pytest.fixture
def folder(made, tmp_path):
    """Return a copy of it that a test may spoil."""
    return shutil.copytree(made, tmp_path / "copy")


def truth_of(folder):
    return json.loads((folder / "set.truth.json").read_text())["records"]


def answer_once(folder, answers, name="mine.jsonl"):
    file = folder / name
    file.write_text("".join(json.dumps(a) + "\n" for a in answers))
    return file


def perfect(folder):
    return [
        {"record": n, "causes": [{"name": c, "probability": 1.0} for c in t["causes"]]}
        for n, t in truth_of(folder).items()
    ]


def scores(folder, *files, capsys):
    assert main(["benchmark", "score", str(folder / "set"), *map(str, files), "--json"]) == 0
    return json.loads(capsys.readouterr().out)["entries"]


def assert_refused(capsys, *words):
    assert main(["benchmark", *map(str, words)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error.startswith("rsea benchmark: ")
    return error


def test_the_truth_as_answer_scores_full_marks(made, capsys):
    table = scores(made, answer_once(made, perfect(made)), capsys=capsys)
    assert table["mine"]["named_right"] == [1.0, 1.0, 1.0]
    assert table["mine"]["false_names"] == [0.0, 0.0, 0.0]
    assert table["mine"]["brier"][0] == 0.0 and table["mine"]["rank"][0] == 1.0
    assert table["no names"]["brier"][0] > 0.0 and table["no names"]["named_right"][0] == 0.0
    assert main(["benchmark", "score", str(made / "set"), str(made / "mine.jsonl")]) == 0
    assert "100 [100, 100]" in capsys.readouterr().out


def test_the_data_set_holds_no_truth(made):
    text = "".join(f.read_text() for f in (made / "set").iterdir())
    for truth in truth_of(made).values():
        assert truth["salt"] not in text
        for parameters in truth["causes"].values():
            assert not any(repr(v) in text for v in parameters.values() if len(repr(v)) > 8)
    manifest = json.loads((made / "set" / "manifest.json").read_text())
    assert set(manifest["records"]) == set(truth_of(made)) and "seed" not in manifest


def test_records_and_rigs_are_read_back(made):
    dataset = read_dataset(made / "set")
    for name in dataset.hashes:
        record = dataset.record(name)
        assert record["ft"].rate == pytest.approx(280.0, rel=1e-4) and len(record["command"]) == 1400
        assert np.all(record["ft"].t > record["command"].t)
        assert load_rig(dataset.rig_path(name)).name == "paper_high_impedance"


def test_every_hidden_effect_shows(made):
    times = [v for t in truth_of(made).values() for v in t["times_noise"].values()]
    assert times and min(times) >= 1.0


def test_a_seed_gives_the_same_records_and_another_seed_others(made, tmp_path):
    for name, seed in (("same", "1"), ("other", "2")):
        words = ["--records", "1", "--duration", "5", "--seed", seed]
        assert main(["benchmark", "make", str(tmp_path / name), *words]) == 0
    same, other, first = (f / "r0001.csv" for f in (tmp_path / "same", tmp_path / "other", made / "set"))
    assert same.read_text() == first.read_text() != other.read_text()


def test_a_secret_seed_that_could_be_guessed_is_refused(tmp_path, capsys):
    (tmp_path / "seed").write_text("12345\n")
    error = assert_refused(capsys, "make", tmp_path / "set", "--seed-file", tmp_path / "seed")
    assert "5 characters, expected at least 16" in error and not (tmp_path / "set").exists()


def test_a_tampered_truth_is_refused(folder, capsys):
    file = folder / "set.truth.json"
    truth = json.loads(file.read_text())
    truth["records"]["r0002"]["causes"] = {"backlash": {"gap": 1e-3}}
    file.write_text(json.dumps(truth))
    error = assert_refused(capsys, "score", folder / "set", answer_once(folder, perfect(folder)))
    assert "records.r0002 has the hash" in error and "not the truth that was committed to" in error


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("{", "line 1: Expecting property name enclosed in double quotes, expected JSON"),
        ('{"record": "r0009", "causes": []}', "record = 'r0009', expected one of"),
        ('{"record": "r0001", "causes": [{"name": "backlsh", "probability": 1}]}', "did you mean backlash?"),
        ('{"record": "r0001", "causes": [{"name": "backlash", "probability": 1.1}]}', "expected 0 to 1"),
        ('{"record": "r0001", "causes": [{"name": "backlash", "probability": NaN}]}', "expected 0 to 1"),
        ('{"record": "r0001", "causes": []}\n{"record": "r0001", "causes": []}', "line 2: a second answer"),
        ("", "no answer"),
    ],
)
def test_a_bad_file_of_answers_gives_one_line(folder, line, expected, capsys):
    (folder / "bad.jsonl").write_text(line)
    assert expected in assert_refused(capsys, "score", folder / "set", folder / "bad.jsonl")


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("version", "0", "version = '0', expected '1'"),
        ("records", {}, "expected a hash for each record"),
        ("records", {"../r0001": "0"}, "expected names such as r0001"),
        ("effects", None, "expected the effects that can be named"),
    ],
)
def test_a_manifest_of_another_kind_is_refused(folder, key, value, expected, capsys):
    file = folder / "set" / "manifest.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    assert expected in assert_refused(capsys, "run", folder / "set", "--out", folder / "answers.jsonl")


def test_a_late_or_missing_answer_names_nothing(made, capsys):
    late = [{**a, "seconds": 120.5} for a in perfect(made)]
    answers = answer_once(made, late, "late.jsonl"), answer_once(made, late[:1], "one")
    table = scores(made, *answers, capsys=capsys)
    assert table["late"] == table["one"] == table["no names"]


def test_the_projects_answers_are_the_probabilities_of_its_diagnosis(made, monkeypatch, capsys):
    cause = SimpleNamespace(name="backlash", probability=0.4)
    rival = SimpleNamespace(name="dead_zone", probability=0.6)
    result = SimpleNamespace(causes=[cause], alternatives=[rival])
    monkeypatch.setattr(scoring, "diagnose", lambda records, rig: result)
    out = made / "answers.jsonl"
    assert main(["benchmark", "run", str(made / "set"), "--out", str(out)]) == 0
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    assert len(lines) == RECORDS
    assert [c["name"] for c in lines[0]["causes"]] == ["dead_zone", "backlash"]
    assert "next        rsea benchmark score" in capsys.readouterr().out


def test_a_record_that_cannot_be_diagnosed_is_reported(made, monkeypatch, tmp_path, capsys):
    from rsea_ros.errors import IdentificationError

    def refuse(record, rig):
        raise IdentificationError("too short")

    monkeypatch.setitem(scoring.ENTRIES, "diagnose", refuse)
    assert main(["benchmark", "run", str(made / "set"), "--out", str(tmp_path / "a.jsonl")]) == 0
    assert "refused     4 records, no effect named; the first: too short" in capsys.readouterr().out


def test_a_stopped_run_goes_on_where_it_stopped(made, tmp_path, monkeypatch):
    asked = []

    def stop_run(record, rig):
        asked.append(record.source)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return Answer({"backlash": 0.5})

    monkeypatch.setitem(scoring.ENTRIES, "diagnose", stop_run)
    words = ["benchmark", "run", str(made / "set"), "--out", str(tmp_path / "a.jsonl")]
    assert main(words) == 130 and not (tmp_path / "a.jsonl").exists()
    with (tmp_path / "a.jsonl.partial").open("a") as partial:
        partial.write('\n{"record": "r0003", "cau')
    assert main(words) == 0
    assert len(asked) == RECORDS + 1 and not (tmp_path / "a.jsonl.partial").exists()
    lines = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    assert [line["record"] for line in lines] == list(read_dataset(made / "set").hashes)
    assert all(set(line) == {"record", "causes", "seconds"} for line in lines)


@pytest.mark.parametrize("name", ["mine.jsonl", "random.jsonl"])
def test_two_rows_of_one_name_are_refused(folder, name, capsys):
    files = [answer_once(folder, perfect(folder)), answer_once(folder, perfect(folder), name)]
    assert f"a second row {name[:-6]!r}" in assert_refused(capsys, "score", folder / "set", *files)
