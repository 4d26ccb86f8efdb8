"""Walking logs of a series elastic robot: dated missions, twelve joints side by side in one group."""

from __future__ import annotations

import shutil
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
from missions import JOINTS, NOT_WALKING, STIFFNESS, torque, write_mission

from msg_adapters import read_record
from rsea_ros.cli.main import main
from rsea_ros.fleet.analysis import read_run
from rsea_ros.fleet.joints import load_joints
from rsea_ros.fleet.query import answer
from rsea_ros.fleet.sources import bags_of, fingerprint, relist
from rsea_ros.fleet.store import open_store

ROOT = Path(__file__).parents[2]
OCTOBER, NOVEMBER = "2024-10-01-11-29-55", "2024-11-02-17-18-32"


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with two missions: a tar file as the hub ships it, and one that was unpacked."""
    folder = tmp_path_factory.mktemp("missions")
    shutil.rmtree(write_mission(folder, OCTOBER).with_suffix(""))
    write_mission(folder, NOVEMBER, packed=False)
    return folder


def test_the_joints_of_a_mission_become_bags(missions, tmp_path, capsys):
    file = missions / OCTOBER / "data" / "anymal_state_actuator.tar"
    run = ["import", str(file), "--map", "grand_tour", "--index", "0,11", "--out", str(tmp_path / "legs")]
    assert main(run) == 0
    command, measured, deflection = (values[:-NOT_WALKING] for values in torque())
    for joint in (0, 11):
        record = read_record(tmp_path / "legs" / f"anymal_state_actuator-joint{joint}")
        share = 1.0 - joint / 100.0
        assert np.allclose(record["command"].y, share * command, atol=1e-9)
        assert np.allclose(record["ft"].y, share * measured, atol=1e-12)
        assert np.allclose(record["deflection"].y, deflection, atol=1e-12)
    assert "at 400.0 Hz" in capsys.readouterr().out


def test_a_map_with_the_number_of_a_joint_in_its_names_asks_for_it(missions, tmp_path, capsys):
    file = missions / OCTOBER / "data" / "anymal_state_actuator.tar"
    run = ["import", str(file), "--map", "grand_tour", "--out", str(tmp_path / "leg")]
    assert main(run) == 2
    assert "holds several joints, expected the number of one, from 0 (--index)" in capsys.readouterr().err
    assert main([*run, "--index", "12"]) == 2
    assert "no column '12_command_mode', expected one of 00_command_joint_torque" in capsys.readouterr().err


def test_every_mission_holds_the_twelve_joints(missions):
    joints = load_joints(ROOT / "config" / "fleet" / "grand_tour.yaml")
    held = [(bag, names) for bag, names in bags_of([str(missions)], joints) if names]
    assert [len(names) for _, names in held] == [JOINTS, JOINTS]
    stamps = {}
    for bag, names in held:
        runs = [read_run(Path(bag.url), bag.url, joint) for joint in names]
        ratio = [np.ptp(run.lenient["ft"].y) / np.ptp(runs[0].lenient["ft"].y) for run in runs]
        assert np.allclose(ratio, 1.0 - np.arange(JOINTS) / 100.0)
        stamps[bag.url.split("/")[-3]] = {run.time for run in runs}
    assert stamps == {
        OCTOBER: {datetime(2024, 10, 1, 11, 29, 55, tzinfo=timezone.utc)},
        NOVEMBER: {datetime(2024, 11, 2, 17, 18, 32, tzinfo=timezone.utc)},
    }


def test_a_group_in_a_folder_is_one_recording_with_all_its_arrays(missions, tmp_path):
    shutil.copytree(missions / NOVEMBER, tmp_path / NOVEMBER)
    joints = load_joints(ROOT / "config" / "fleet" / "grand_tour.yaml")
    ((bag, _),) = [(bag, names) for bag, names in bags_of([str(tmp_path)], joints) if names]
    before = fingerprint(bag)
    with open(f"{bag.url}/00_state_joint_torque/0", "ab") as file:
        file.write(b"more")
    assert relist(bag) != bag and relist(bag).size == bag.size + 4
    assert fingerprint(bag) != before


def test_the_fleet_has_the_stiffness_of_each_joint_at_its_date(missions, tmp_path):
    shipped = (ROOT / "config" / "fleet" / "grand_tour.yaml").read_text(encoding="utf-8")
    head = shipped[: shipped.index("joints:")]
    (tmp_path / "joints.yaml").write_text(f"{head}joints:\n  LF_HAA: {{index: 0}}\n  RH_KFE: {{index: 11}}\n")
    run = ["fleet", "run", str(missions / OCTOBER), "--map", str(tmp_path / "joints.yaml"), "--serial"]
    assert main([*run, "--out", str(tmp_path / "s")]) == 0
    sql = "SELECT joint, time::DATE::VARCHAR, value, low, high FROM parameters"
    where = "WHERE parameter = 'spring.stiffness' ORDER BY joint"
    rows = answer(open_store(tmp_path / "s"), f"{sql} {where}")[1]
    assert [row[:2] for row in rows] == [("LF_HAA", "2024-10-01"), ("RH_KFE", "2024-10-01")]
    for (_, _, value, low, high), share in zip(rows, (1.0, 0.89), strict=True):
        assert low < share * STIFFNESS < high and abs(value / (share * STIFFNESS) - 1.0) < 0.01
