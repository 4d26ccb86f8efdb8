"""A real small recording: read, identified, written; the same rows on Dask's workers as in this process."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from msg_adapters import write_record
from rsea_extras.fleet.joints import date_in
from rsea_extras.fleet.store import read
from rsea_extras.fleet.task import Changed, Task, read_fingerprint, work
from rsea_ros.cli.main import main
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig, rig_text
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"
MARCH_NS = 1_772_700_000_000_000_000
MAP = """
joints:
  knee: {rig: paper_high_impedance, bags: "knee*", diagnose: never}
"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a map, two good recordings, one where nothing moves and one that is not a bag."""
    folder = tmp_path_factory.mktemp("lab")
    (folder / "joints.yaml").write_text(MAP, encoding="utf-8")
    u = excitation("chirp", ExcitationSettings(duration=5.0))
    command = Channel(np.arange(len(u)) / 280.0, u)
    for seed in (1, 2):
        record = synthesize(load_rig(RIG), command, seed=seed)
        write_record(replace(record, epoch_ns=MARCH_NS), folder / f"knee{seed}.mcap")
    still = synthesize(load_rig(RIG), Channel(command.t, 0.0 * u), noise=False)
    write_record(still, folder / "knee3.mcap")
    (folder / "knee4.mcap").write_bytes(b"no bag at all")
    return folder


@pytest.fixture(scope="module")
def serial(lab: Path) -> Path:
    assert main([*run_node_process(lab), "--out", str(lab / "serial"), "--serial"]) == 0
    return lab / "serial"


def run_node_process(lab: Path) -> list[str]:
    return ["fleet", "run", str(lab), "--map", str(lab / "joints.yaml")]


def rows(store: Path) -> list[dict[str, object]]:
    tables = [read(file) for file in store.glob("rows/joint=*/month=*/*.parquet")]
    table = pa.concat_tables(tables).drop_columns(["seconds", "peak_memory", "written", "stamp"])
    return sorted(table.to_pylist(), key=lambda row: row["bag"])


def test_a_good_recording_is_a_row_with_its_parameters_and_artefacts(serial):
    first, *_ = rows(serial)
    assert (first["outcome"], first["verdict"]) == ("done", "adequate")
    assert first["time"] == datetime.fromtimestamp(MARCH_NS * 1e-9, timezone.utc)
    assert {p["name"] for p in first["parameters"]} >= {"spring.stiffness", "rotor.reflected_inertia"}
    stiffness = next(p for p in first["parameters"] if p["name"] == "spring.stiffness")
    assert stiffness["low"] < stiffness["value"] < stiffness["high"] and stiffness["identifiable"]
    assert stiffness["value"] == pytest.approx(load_rig(RIG)["spring.stiffness"], rel=0.01)
    artefacts = json.loads((serial / first["artefacts"] / "identification.json").read_text())
    assert artefacts["parameters"]["spring.stiffness"]["value"] == stiffness["value"]


def test_a_bad_recording_is_a_row_with_its_reason(serial):
    _, _, still, nothing = rows(serial)
    assert still["outcome"] == nothing["outcome"] == "refused"
    assert "nothing moves" in still["reason"] and still["duration"] == pytest.approx(5.0, abs=0.1)
    assert str(nothing["bag"]) in nothing["reason"] and nothing["parameters"] == []


def test_rows_of_workers_are_those_of_this_process(lab, serial, capsys):
    out = lab / "workers"
    arguments = [*run_node_process(lab), "--out", str(out)]
    capsys.readouterr()
    assert main([*arguments, "--workers", "1"]) == 0
    assert "2 done, 2 refused" in capsys.readouterr().out
    assert rows(out) == rows(serial)
    assert main([*arguments, "--fail-on", "refused"]) == 0
    said = capsys.readouterr()
    assert "nothing new, 4 in the store before" in said.out and not said.err, "no worker is started for that"


def test_sql_answers_and_changes_nothing(serial, capsys):
    ask = ["fleet", "sql", "--store", str(serial)]
    assert main([*ask, "--json", "SELECT joint, time, outcome FROM recordings ORDER BY bag LIMIT 1"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["joint"], row["outcome"]) == ("knee", "done") and row["time"].startswith("2026-03-05T")
    assert main([*ask, "--csv", "SELECT count(*) AS n FROM parameters"]) == 0
    assert capsys.readouterr().out == "n\n8\n"
    wrong = ["DROP VIEW recordings", "COPY (SELECT 1) TO 'x.csv'", "SELECT 1; SELECT 2", "SELECT no"]
    for query in [*wrong, f"SELECT * FROM read_text('{Path(__file__)}')"]:
        assert main([*ask, query]) == 2
        assert "rsea fleet: " in capsys.readouterr().err


def test_a_recording_that_grows_while_it_is_read_makes_no_row(lab, tmp_path):
    from rsea_extras.fleet.joints import MappedJoint
    from rsea_extras.fleet.sources import bags_of

    (tmp_path / "run.mcap").write_bytes((lab / "knee1.mcap").read_bytes())
    joint = MappedJoint("knee", rig_text(load_rig(RIG)), diagnose="never")
    ((bag, _),) = bags_of([str(tmp_path)], [joint])
    bag, recording = read_fingerprint(bag)
    with (tmp_path / "run.mcap").open("ab") as file:
        file.write(b"more")
    with pytest.raises(Changed):
        work(Task(bag, joint, recording, "1"))


@pytest.mark.parametrize(
    ("path", "pattern", "date"),
    [
        ("/lab/2024-07-18__10-58-26__ramp.csv", "%Y-%m-%d__%H-%M-%S", datetime(2024, 7, 18, 10, 58, 26)),
        ("/2025-01-01/left/2026-03-02", "%Y-%m-%d", datetime(2026, 3, 2)),
        ("/lab/20261301/run", "%Y%m%d", None),
        ("/lab/run", "%Y-%m-%d", None),
    ],
)
def test_a_date_stands_in_the_path(path, pattern, date):
    assert date_in(path, pattern) == (date and date.replace(tzinfo=timezone.utc))


def test_a_run_keeps_the_page_of_a_diagnosis_only_on_request(lab: Path, tmp_path: Path) -> None:
    """The pages of a joint linked the raw diagnosis.json, because no run wrote a page."""
    call = ["fleet", "run", str(lab / "knee1.mcap"), "--map", str(lab / "joints.yaml"), "--serial"]
    assert main([*call, "--diagnose", "always", "--pages", "--out", str(tmp_path / "with")]) == 0
    assert main([*call, "--out", str(tmp_path / "without")]) == 0
    (page,) = (tmp_path / "with").rglob("report.html")
    assert "rsea diagnose" in page.read_text(encoding="utf-8")
    assert not list((tmp_path / "without").rglob("report.html"))
    assert main(["fleet", "report", str(tmp_path / "with"), "--out", str(tmp_path / "pages")]) == 0
    assert "/report.html" in (tmp_path / "pages" / "joint-knee.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "option",
    [["--workers", "0"], ["--memory", "-1"], ["--serial", "--scheduler", "x"], ["--time-limit", "0"]],
)
def test_senseless_options_are_refused(lab, option, capsys):
    assert main([*run_node_process(lab), "--out", str(lab / "no"), *option]) == 2
    assert option[0] in capsys.readouterr().err and not (lab / "no").exists()
