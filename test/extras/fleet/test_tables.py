"""Tables of several joints side by side: a joint map names the import map and the number of each joint."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest

from rsea_extras.fleet.query import answer
from rsea_extras.fleet.store import open_store
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

STIFFNESS, RATE, LENGTH = 2155.0, 400.0, 2401
"""N m/rad of joint 0; that of joint i is smaller by i percent, and its torque too. Hz. Rows."""
OTHER_MODE = 200
"""Rows at the end in another mode of the drive: no number in them is of use."""
IMPORT = """
time: {column: timestamp, unit: s}
where: {column: "##_mode", equals: 13}
channels:
  command: {column: "##_command", unit: N m}
  ft: {column: "##_torque", unit: N m}
  deflection: {expression: 'column("##_gear") - column("##_joint")', unit: rad}
"""
JOINTS = """
defaults: {rig: sea_two_encoders, import: map.yaml, bags: "*/joints.npz", diagnose: never}
joints: {knee: {index: 0}, ankle: {index: 11}}
"""
MISSIONS = (datetime(2024, 10, 1, 11, tzinfo=timezone.utc), datetime(2024, 11, 2, 17, tzinfo=timezone.utc))


@pytest.fixture(scope="module")
def missions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with two missions of two joints, their import map and joint map."""
    folder = tmp_path_factory.mktemp("missions")
    t, rng = np.arange(LENGTH) / RATE, np.random.default_rng(5)
    parts = [rng.normal() * np.sin(2 * np.pi * 0.7 * (k + 1) * t) / np.sqrt(1 + k / 4) for k in range(30)]
    command = 8.0 * np.sum(parts, axis=0)
    record = synthesize(load_rig("sea_two_encoders"), Channel(t, command), seed=1)
    mode = np.where(np.arange(LENGTH - 1) < LENGTH - 1 - OTHER_MODE, 13, 1)
    angle = 0.3 * np.sin(4.0 * t[:-1])
    arrays = {}
    for joint in (0, 11):
        share, name = 1.0 - joint / 100.0, f"{joint:02d}_"
        arrays |= {
            f"{name}mode": mode,
            f"{name}command": np.where(mode == 13, share * command[1:], 1e6),
            f"{name}torque": share * record["ft"].y[:-1],
            f"{name}gear": angle + record["deflection"].y[:-1],
            f"{name}joint": angle,
        }
    for begin in MISSIONS:
        (folder / f"{begin:%Y-%m}").mkdir()
        np.savez(folder / f"{begin:%Y-%m}" / "joints.npz", timestamp=begin.timestamp() + t[:-1], **arrays)
    (folder / "map.yaml").write_text(IMPORT)
    (folder / "joints.yaml").write_text(JOINTS)
    return folder


def test_the_fleet_has_the_stiffness_of_each_joint_at_its_date(missions, tmp_path):
    run = ["fleet", "run", str(missions / "2024-10"), "--map", str(missions / "joints.yaml"), "--serial"]
    assert main([*run, "--out", str(tmp_path / "s")]) == 0
    sql = "SELECT joint, time::DATE::VARCHAR, value, low, high FROM parameters"
    where = "WHERE parameter = 'spring.stiffness' ORDER BY joint"
    rows = answer(open_store(tmp_path / "s"), f"{sql} {where}")[1]
    assert [row[:2] for row in rows] == [("ankle", "2024-10-01"), ("knee", "2024-10-01")]
    for (_, _, value, low, high), share in zip(rows, (0.89, 1.0), strict=True):
        assert low < share * STIFFNESS < high and abs(value / (share * STIFFNESS) - 1.0) < 0.01
