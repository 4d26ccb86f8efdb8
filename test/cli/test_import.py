"""`rsea import` as a person runs it: exit status, one line for each mistake, nothing half-written."""

from __future__ import annotations

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


def test_a_table_becomes_a_bag_with_its_measurement(inputs, capsys):
    file, mapping, out = inputs
    words = ["--out", str(out), "--storage", "sqlite3", "--namespace", "/lab"]
    assert main(["import", file, "--map", mapping, *words]) == 0
    record = read_record(out, topics=TopicMap(namespace="/lab"))
    assert np.allclose(record["command"].y, np.arange(20) * 0.5)
    assert np.allclose(record["position"].y, np.radians(np.arange(20) * 2))
    assert np.allclose(record["position"].t, np.arange(20) * 1e-3)
    assert record.notes == ("imported from run.csv, map.yaml",)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "command: 20 samples of u [N·m], 0 to 9.5 N·m"
    assert lines[-1] == f"{out}: 0.019 s at 1000.0 Hz"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["{file}", "--map", "{map}", "--out", "{file}", "--force"], "run.csv: is the input"),
        (["{file}", "--map", "{map}", "--out", "/proc/nothing/bag"], "/proc/nothing: cannot be made"),
    ],
)
def test_senseless_paths_and_options_are_refused(inputs, refused, arguments, text):
    names = dict(zip(("{file}", "{map}", "{out}"), inputs, strict=True))
    line = refused("import", *(names.get(argument, argument) for argument in arguments))
    assert line.startswith("rsea import: ") and text in line
    assert not inputs[2].exists()


@pytest.mark.parametrize("name", ["bag", "bag.mcap", "bag.db3"])
def test_missing_values_are_a_fault_of_the_bag(name, inputs, tmp_path, capsys):
    """A bag of a single file did not keep the count."""
    file, mapping, _ = inputs
    Path(file).write_text(Path(file).read_text().replace("7,3.5,14", "7,,14"))
    assert main(["import", file, "--map", mapping, "--out", str(tmp_path / name)]) == 0
    record = read_record(tmp_path / name)
    (fault,) = (f for f in record.faults if f.kind == "missing_values")
    assert (fault.channel, fault.share) == ("command", 0.05)
    assert f"command: {fault.detail}" in capsys.readouterr().out.splitlines()
    assert fault.detail == "1 of 20 values of u are missing, the first at 0.007 s"
    assert any(note.endswith("imported from run.csv, map.yaml") for note in record.notes)


@pytest.mark.parametrize(
    "text", ["[[[", "7", '[["clipping", "ft", 0.1, "x"]]', '[["missing_values", 1]]', "[" * 9999]
)
def test_remarks_of_another_program_in_a_bag_are_ignored(text):
    assert remarks_of({FAULTS: text}).faults == []
