"""Missions of GrandTour as its public schema says: made here, nothing of the data set is copied."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from zarr_groups import as_tar, write_group

from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

STIFFNESS = 700.0
"""N m/rad of joint 0; that of joint i is smaller by i percent, its torque too."""
GAINS = {"p": 85.0, "d": 0.5}
"""N m/rad, N m s/rad: exact in 32 bits."""
JOINTS, RATE, LENGTH = 12, 400.0, 2401
NOT_WALKING = 200
"""Rows at the end in another mode of the drive: no number in them is of use."""


def begin(mission: str) -> float:
    """Return the stamp of a mission that its name would have in UTC."""
    return datetime.strptime(mission, "%Y-%m-%d-%H-%M-%S").replace(tzinfo=timezone.utc).timestamp()


def torque() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return command, torque (N m) and deflection (rad) of joint 0, at the same instants."""
    t = np.arange(LENGTH) / RATE
    rng = np.random.default_rng(5)
    sizes = [8.0 * rng.normal() / np.sqrt(1 + k / 4) for k in range(30)]
    parts = [size * np.sin(2 * np.pi * 0.7 * (k + 1) * t) for k, size in enumerate(sizes)]
    rig = load_rig("anymal_joint").with_values({"spring.stiffness": STIFFNESS})
    command = np.sum(parts, axis=0)
    record = synthesize(rig, Channel(t, command), seed=1)
    return command[1:], record["ft"].y[:-1], record["deflection"].y[:-1]


def write_mission(folder: Path, mission: str, packed: bool = True) -> Path:
    """Write a mission with twelve walking joints; return its group, or the tar file of it."""
    command, measured, deflection = torque()
    t = np.arange(len(command)) / RATE
    angle, speed = 0.3 * np.sin(4.0 * t), 1.2 * np.cos(4.0 * t)
    arrays: dict[str, np.ndarray] = {"timestamp": begin(mission) + t}
    arrays["sequence_id"] = np.arange(len(t), dtype="<u8")
    for joint in range(JOINTS):
        share, name = 1.0 - joint / 100.0, f"{joint:02d}_"
        forward = share * command - GAINS["p"] * 0.05 - GAINS["d"] * (0.1 - speed)
        mode = np.full(len(t), 13, "u1")
        mode[-NOT_WALKING:] = 1
        forward[-NOT_WALKING:] = 1e6
        arrays |= {
            f"{name}command_mode": mode,
            f"{name}command_joint_torque": forward,
            f"{name}command_position": angle + 0.05,
            f"{name}command_velocity": np.full(len(t), 0.1),
            f"{name}command_pid_gains_p": np.full(len(t), GAINS["p"], "<f4"),
            f"{name}command_pid_gains_d": np.full(len(t), GAINS["d"], "<f4"),
            f"{name}state_joint_position": angle,
            f"{name}state_joint_velocity": speed,
            f"{name}state_gear_position": angle + deflection,
            f"{name}state_joint_torque": share * measured,
        }
    group = write_group(folder / mission / "data" / "anymal_state_actuator", arrays, chunk=1 << 12)
    return as_tar(group) if packed else group
