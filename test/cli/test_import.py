"""`rsea import` as a person runs it: exit status, one line for each mistake, nothing half-written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from msg_adapters import TopicMap, read_record
from msg_adapters.contents import FAULTS, remarks_of
from rsea_ros.cli.main import main

MAP = """
time: {column: t, unit: ms}
channels:
  command: {column: u, unit: N*m}
  position: {column: x, unit: deg}
"""


@pytest.fixture
def inputs(tmp_path: Path) -> tuple[str, str, Path]:
    (tmp_path / "map.yaml").write_text(MAP)
    rows = "".join(f"{k},{k * 0.5},{k * 2}\n" for k in range(20))
    (tmp_path / "run.csv").write_text(f"t,u,x\n{rows}")
    return str(tmp_path / "run.csv"), str(tmp_path / "map.yaml"), tmp_path / "bag"


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_table_becomes_a_bag_with_its_measurement(inputs, capsys, storage):
    file, mapping, out = inputs
    assert (
        main(
            ["import", file, "--map", mapping, "--out", str(out), "--storage", storage, "--namespace", "/lab"]
        )
        == 0
    )
    record = read_record(out, topics=TopicMap(namespace="/lab"))
    assert np.allclose(record["command"].y, np.arange(20) * 0.5)
    assert np.allclose(record["position"].y, np.radians(np.arange(20) * 2))
    assert np.allclose(record["position"].t, np.arange(20) * 1e-3)
    assert record.notes == ("imported from run.csv, map.yaml",)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "command: 20 samples of u [N·m], 0 to 9.5 N·m"
    assert lines[-1] == f"{out}: 0.019 s at 1000.0 Hz"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            ("run.csv", "7.0,28", "7.0,lots"),
            "run.csv: line 16, column 'x' is 'lots', expected a finite number",
        ),
        (("run.csv", "t,u,x", "t,u,y"), "run.csv: no column 'x', expected one of t, u, y"),
        (
            ("map.yaml", "deg", "gon"),
            "map.yaml: line 5: channels.position: unit 'gon' unknown, expected one of",
        ),
        (("map.yaml", "position", "angle"), "map.yaml: line 5: channels: unknown key 'angle'"),
    ],
)
def test_mistakes_in_a_map_are_one_line_and_status_2(inputs, capsys, change, text):
    file, mapping, out = inputs
    name, old, new = change
    path = out.parent / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    assert main(["import", file, "--map", mapping, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert text in captured.err
    assert sorted(entry.name for entry in out.parent.iterdir()) == ["map.yaml", "run.csv"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nothing.csv", "--map", "{map}", "--out", "{out}"], "nothing.csv: No such file"),
        (["{file}", "--map", "nothing.yaml", "--out", "{out}"], "nothing.yaml: No such file"),
        (["{file}", "--map", "{map}", "--out", "{map}"], "map.yaml: is the input"),
        (["{file}", "--map", "{map}", "--out", "{file}", "--force"], "run.csv: is the input"),
        (["{file}", "--map", "{map}", "--out", "/proc/nothing/bag"], "/proc/nothing: cannot be made"),
        (
            ["{file}", "--map", "{map}", "--out", "{out}", "--topic", "a=b"],
            "topic 'a=b': expected ROLE=TOPIC",
        ),
    ],
)
def test_senseless_paths_and_options_are_refused(inputs, capsys, arguments, text):
    names = dict(zip(("{file}", "{map}", "{out}"), map(str, inputs), strict=True))
    assert main(["import", *(names.get(argument, argument) for argument in arguments)]) == 2
    error = capsys.readouterr().err
    assert error.startswith("rsea import: ")
    assert error.count("\n") == 1
    assert text in error
    assert not inputs[2].exists()


def test_the_module_runs_as_a_program(inputs):
    file, mapping, out = inputs
    command = [sys.executable, "-m", "rsea_ros", "import", file, "--map", mapping, "--out", str(out)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (again.returncode, again.stdout) == (2, "")
    assert again.stderr == f"rsea import: {out}: exists already, expected a new name or --force\n"


def test_missing_values_are_reported_on_the_terminal_and_in_the_bag(inputs, capsys):
    file, mapping, out = inputs
    Path(file).write_text(Path(file).read_text().replace("7,3.5,14", "7,,14"))
    assert main(["import", file, "--map", mapping, "--out", str(out)]) == 0
    told = "command: 1 of 20 values of u are missing, the first at 0.007 s"
    assert told in capsys.readouterr().out.splitlines()
    assert told in read_record(out).notes


@pytest.mark.parametrize("name", ["bag", "bag.mcap", "bag.db3"])
def test_missing_values_are_a_fault_of_the_bag(name, inputs, tmp_path):
    """A bag of a single file did not keep the count."""
    file, mapping, _ = inputs
    Path(file).write_text(Path(file).read_text().replace("7,3.5,14", "7,,14"))
    assert main(["import", file, "--map", mapping, "--out", str(tmp_path / name)]) == 0
    record = read_record(tmp_path / name)
    (fault,) = (f for f in record.faults if f.kind == "missing_values")
    assert (fault.channel, fault.share) == ("command", 0.05)
    assert fault.detail == "1 of 20 values of u are missing, the first at 0.007 s"
    assert any(note.endswith("imported from run.csv, map.yaml") for note in record.notes)


@pytest.mark.parametrize(
    "text", ["[[[", "7", '[["clipping", "ft", 0.1, "x"]]', '[["missing_values", 1]]', "[" * 9999]
)
def test_remarks_of_another_program_in_a_bag_are_ignored(text):
    assert remarks_of({FAULTS: text}).faults == []
