"""`rsea import` as a person runs it: one line for each mistake, no half of a bag, a bag a joint and run."""

import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
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


EPISODES = """
time: {column: timestamp, unit: s}
runs: {column: episode_index}
channels:
  reference: {column: "action[#]", unit: deg}
  position: {column: "observation.state[#]", unit: deg}
"""


@pytest.fixture
def episodes(tmp_path):
    """Two episodes of two joints in a file, as LeRobot keeps them."""
    action = np.arange(24.0).reshape(12, 2)
    columns = {
        "action": list(action),
        "observation.state": list(action + 0.5),
        "timestamp": np.tile(np.arange(6) / 30, 2).astype("f4"),
        "episode_index": np.repeat([3, 7], 6),
    }
    pq.write_table(pa.table({n: pa.array(c) for n, c in columns.items()}), tmp_path / "file-000.parquet")
    (tmp_path / "map.yaml").write_text(EPISODES)
    return tmp_path


def test_each_joint_of_each_episode_gets_a_bag(episodes, capsys):
    out = episodes / "bags"
    file, mapping = str(episodes / "file-000.parquet"), str(episodes / "map.yaml")
    assert main(["import", file, "--map", mapping, "--out", str(out), "--index", "0-1"]) == 0
    names = [f"file-000-joint{joint}-run{run}" for joint in (0, 1) for run in (3, 7)]
    assert sorted(path.name for path in out.iterdir()) == sorted(names)
    record = read_record(out / "file-000-joint1-run7")
    assert np.allclose(np.degrees(record["reference"].y), np.arange(6) * 2 + 13)
    assert np.allclose(record["position"].t, np.arange(6) / 30, atol=1e-6)
    assert capsys.readouterr().out.count("Hz\n") == 4


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--index", "0,2"], "column 'action[2]' has a list of 2 numbers, expected more than 2"),
        (["--index", "1-0"], "'1-0', expected the smaller number first"),
        (["--index", "x"], "'x', expected whole numbers >= 0"),
        ([], "column 'action[#]' holds several joints, expected the number of one, from 0 (--index)"),
        (["--index", "0", "--out", "{}.mcap"], "is one bag, expected a folder for several"),
    ],
)
def test_mistakes_leave_nothing_behind(episodes, refused, options, text):
    file, mapping, out = (episodes / name for name in ("file-000.parquet", "map.yaml", "bags"))
    options = [option.format(episodes / "bag") for option in options]
    assert text in refused("import", file, "--map", mapping, "--out", out, *options)
    assert sorted(path.name for path in episodes.iterdir()) == ["file-000.parquet", "map.yaml"]


def test_no_bag_is_written_where_the_second_of_two_files_is_bad(tmp_path, refused):
    (tmp_path / "map.yaml").write_text("time: {rate: 100}\nchannels: {position: {column: x, unit: rad}}\n")
    (tmp_path / "a.csv").write_text("x\n1\n2\n")
    (tmp_path / "b.csv").write_text("x\n1\nlots\n")
    files, out = [str(tmp_path / name) for name in ("a.csv", "b.csv")], tmp_path / "bags"
    words = ["import", *files, "--map", str(tmp_path / "map.yaml"), "--out", str(out)]
    assert "b.csv: line 3, column 'x' is 'lots'" in refused(*words)
    assert not out.exists()
    (tmp_path / "b.csv").write_text("x\n1\n3\n")
    assert main(words) == 0
    assert sorted(path.name for path in out.iterdir()) == ["a", "b"]
    (tmp_path / "a.txt").write_text("x\n1\n2\n")
    twice = refused(*words[:2], str(tmp_path / "a.txt"), *words[2:-1], str(tmp_path / "others"))
    assert "a: is the bag of two inputs, expected other file names" in twice


def test_the_shipped_map_scales_each_joint_of_a_normalised_data_set(episodes):
    """An elbow at 50 % of its travel was read as 50 degrees."""
    file, degrees, share = str(episodes / "file-000.parquet"), episodes / "degrees", episodes / "share"
    assert main(["import", file, "--map", "lerobot", "--index", "1", "--out", str(degrees)]) == 0
    assert main(["import", file, "--map", "lerobot_normalised", "--index", "1", "--out", str(share)]) == 0
    for name in (path.name for path in degrees.iterdir()):
        was, scaled = (read_record(folder / name)["position"].y for folder in (degrees, share))
        assert np.allclose(scaled, np.rad2deg(was) * 0.01745, atol=1e-9)


def test_the_shipped_maps_import_pace_and_echoed_joint_states(tmp_path):
    q = np.arange(20.0).reshape(10, 2)
    np.savez(tmp_path / "chirp_data.npz", time=np.arange(10) / 400, dof_pos=q, des_dof_pos=q + 1)
    out = str(tmp_path / "pace")
    file = str(tmp_path / "chirp_data.npz")
    assert main(["import", file, "--map", "pace", "--index", "1", "--out", out]) == 0
    assert read_record(out)["reference"].y.tolist() == (q[:, 1] + 1).tolist()
    rows = "".join(f"1700000000,{k * 5_000_000},,knee,0.{k},1.5,nan\n" for k in range(1, 9))
    (tmp_path / "run.csv").write_text(rows.replace("nan", "2.5"))
    out = str(tmp_path / "echo")
    assert main(["import", str(tmp_path / "run.csv"), "--map", "joint_states_echo", "--out", out]) == 0
    record = read_record(out)
    assert record["position"].y[0] == 0.1
    assert np.allclose(np.diff(record["position"].t), 0.005, atol=1e-6)


PARSERS = ("None", "codec", "miMATRIX", "Mat file", "int()", "end-of-stream", "gzipped", "indices")
ONE_COLUMN = "time: {rate: 100}\nchannels: {command: {column: u, unit: N m}}\n"
PACKED = gzip.compress(b"u\n1\n2\n", mtime=0)


@pytest.mark.parametrize(
    ("name", "content", "mapped", "said"),
    [
        ("run.csv", b"u\n1\n2\n", "", "map is empty, expected a mapping"),
        ("run.mat", b"hello", ONE_COLUMN, "no MAT file that can be read, expected one up to version 7"),
        ("run.csv.gz", PACKED[:12], ONE_COLUMN, "damaged or no gzip file"),
        ("run.csv.gz", b"\xff\xfe\x00", ONE_COLUMN, "damaged or no gzip file"),
    ],
)
def test_a_mistake_in_a_table_or_its_map_is_described_in_plain_words(
    name, content, mapped, said, tmp_path, refused
):
    (tmp_path / "map.yaml").write_text(mapped)
    (tmp_path / name).write_bytes(content)
    line = refused("import", tmp_path / name, "--map", tmp_path / "map.yaml", "--out", tmp_path / "bag")
    assert said in line and not [word for word in PARSERS if word in line]


def test_predict_says_where_the_rig_goes(refused):
    line = refused("predict", "run.mcap", "--rig", "my_bench.yaml")
    assert "first argument, `rsea predict my_bench.yaml BAG`" in line
