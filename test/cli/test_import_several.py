"""Several joints, runs and files at once: one bag for each, all of them or none."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from msg_adapters import read_record
from rsea_ros.cli.main import main

MAP = """
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
    (tmp_path / "map.yaml").write_text(MAP)
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
