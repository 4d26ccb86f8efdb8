"""Messages and bags made by rosbags, which shares no code with ours."""

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_KILTED)
EPOCH = 1_763_000_000_123_456_789
JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH = "geometry_msgs/msg/WrenchStamped"


def make(msgtype: str, **fields: Any) -> Any:
    """Make a message of rosbags' own types."""
    return STORE.types[msgtype](**fields)


def header(stamp: int, frame: str = "") -> Any:
    time = make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def joint_state(
    stamp: int,
    names: Sequence[str] = ("joint",),
    position: Sequence[float] = (),
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
    frame: str = "",
) -> Any:
    arrays = {"position": position, "velocity": velocity, "effort": effort}
    values = {name: np.array(array, float) for name, array in arrays.items()}
    return make(JOINT_STATE, header=header(stamp, frame), name=list(names), **values)


def wrench(stamp: int, values: Sequence[float], frame: str = "ft") -> Any:
    force, torque = (
        make("geometry_msgs/msg/Vector3", x=v[0], y=v[1], z=v[2]) for v in (values[:3], values[3:])
    )
    whole = make("geometry_msgs/msg/Wrench", force=force, torque=torque)
    return make(WRENCH, header=header(stamp, frame), wrench=whole)


def numbers(*values: float) -> Any:
    """Make the message of a forward controller's commands."""
    layout = make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    return make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(values, float))


Row = tuple[str, int, Any]
Packing = Ros1Writer.CompressionFormat


def write_foreign(
    path: Path,
    rows: Sequence[Row],
    storage: StoragePlugin = StoragePlugin.MCAP,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    """Write rows of (topic, log time, message); return the path."""
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    connections: dict[str, Any] = {}
    with writer:
        for topic, log_time, message in rows:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], log_time, raw_of(message))
    return path


def raw_of(message: Any) -> bytes:
    """Return the bytes of a message."""
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def spoilt_database(path: Path, *statements: str) -> Path:
    """Write a run of 60 samples as a database and change it; return the path of the bag."""
    bag = write_foreign(path, run_rows(60), StoragePlugin.SQLITE3)
    with closing(sqlite3.connect(bag / f"{path.name}.db3")) as database, database:
        for statement in statements:
            database.execute(statement)
    return bag


def write_ros1(path: Path, rows: Sequence[Row], compression: Packing | None = None) -> Path:
    """Write the rows as a bag of ROS 1, in chunks of 20 kB; return the path."""
    noetic, connections = get_typestore(Stores.ROS1_NOETIC), dict[str, Any]()
    writer = Ros1Writer(path)
    writer.chunk_threshold = 20_000
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        for topic, log_time, message in rows:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=noetic)
            raw = STORE.cdr_to_ros1(raw_of(message), kind)
            writer.write(connections[topic], log_time, raw)
    return path


def run_rows(count: int = 50, prefix: str = "/rsea") -> list[Row]:
    """Return a small run: command, state and wrench, three messages a sample."""
    rows: list[Row] = []
    for k in range(count):
        at = EPOCH + k * 3_571_428
        rows.append((f"{prefix}/torque_command", at, joint_state(at, effort=[k * 0.5])))
        state = joint_state(at + 1000, position=[k * 0.1], velocity=[k * 0.2], effort=[k * 0.3])
        rows.append((f"{prefix}/joint_states", at + 1000, state))
        rows.append((f"{prefix}/ft", at + 2000, wrench(at + 2000, [1.0, 2.0, 3.0, 4.0, 5.0, k * 0.7])))
    return rows
