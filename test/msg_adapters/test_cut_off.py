"""Recordings that broke off: what is complete comes back, with a note, and never a traceback."""

from __future__ import annotations

import os
import random
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from foreign import run_rows, write_foreign
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from msg_adapters import BagWriter, read_record
from msg_adapters.bags import read_contents
from rsea_ros.errors import BagError

RECORDER = """
import sys, time
import numpy as np
from msg_adapters import BagWriter
from msg_adapters.cdr import joint_states, wrenches
with BagWriter(sys.argv[1], sys.argv[2]) as bag:
    for k in range(1_000_000):
        stamps = np.array([1_763_000_000_000_000_000 + k * 3_571_428])
        (command,) = joint_states(stamps, "joint", effort=np.array([k * 0.5]))
        (ft,) = wrenches(stamps, np.full((1, 6), k * 0.25))
        bag.write("/rsea/torque_command", "sensor_msgs/msg/JointState", int(stamps[0]), command)
        bag.write("/rsea/ft", "geometry_msgs/msg/WrenchStamped", int(stamps[0]), ft)
        if k == 700:
            bag.flush()
            print("flushed", flush=True)
        if k >= 700:
            time.sleep(0.001)
"""


def _chunk(path: Path, compression: CompressionMode) -> bytes:
    """Return an MCAP file with many chunks: each run of rosbags' writer holds a chunk."""
    rows = run_rows(120)
    data = b""
    for part in range(6):
        bag = write_foreign(
            path / f"{part}", rows[part * 60 : part * 60 + 60], StoragePlugin.MCAP, compression
        )
        whole = (bag / f"{part}.mcap").read_bytes()
        at, end = (0 if not data else 8), whole.index(struct.pack("<BQI", 0x0F, 4, 0))
        data += whole[at:end]
    return data


def _messages_of_complete_chunks(data: bytes) -> int:
    """Count the messages of the chunks that lie wholly before the end."""
    at, count = 8, 0
    while at + 9 <= len(data):
        opcode, size = struct.unpack_from("<BQ", data, at)
        at += 9 + size
        if at <= len(data) and opcode == 0x06:
            count += 60
    return count


@pytest.mark.parametrize("compression", [CompressionMode.NONE, CompressionMode.STORAGE])
def test_every_complete_chunk_before_the_cut_comes_back(tmp_path, compression):
    data = _chunk(tmp_path, compression)
    rng = random.Random(20)
    cuts = [rng.randrange(1, len(data)) for _ in range(150)]
    recovered = []
    for cut in [*cuts, len(data)]:
        file = tmp_path / "cut.mcap"
        file.write_bytes(data[:cut])
        try:
            contents = read_contents(file)
        except BagError as error:
            assert cut < 8
            assert "no MCAP file" in str(error)
            continue
        got = sum(len(messages.raw) for messages in contents.topics.values())
        complete = _messages_of_complete_chunks(data[:cut])
        assert complete <= got <= complete + 60
        assert "cut off" in contents.notes[0]
        recovered.append(got)
    assert max(recovered) == 360
    assert len(set(recovered)) > 5


def test_a_cut_off_bag_is_a_record_up_to_the_cut(tmp_path):
    data = _chunk(tmp_path, CompressionMode.NONE)
    file = tmp_path / "cut.mcap"
    file.write_bytes(data[: len(data) // 2])
    record = read_record(file)
    full = np.arange(120) * 0.5
    got = record["command"].y
    assert 40 <= len(got) <= 62
    assert np.array_equal(got, full[: len(got)])
    assert "cut off (recorder killed?)" in record.notes[0]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_killed_recorder_leaves_a_bag_that_opens(tmp_path, storage):
    bag = tmp_path / "run"
    with subprocess.Popen(
        [sys.executable, "-c", RECORDER, str(bag), storage], stdout=subprocess.PIPE, cwd=os.getcwd()
    ) as recorder:
        assert recorder.stdout is not None
        assert recorder.stdout.readline() == b"flushed\n"
        recorder.send_signal(signal.SIGKILL)
    assert not bag.exists()
    record = read_record(tmp_path / "run.partial")
    count = len(record["ft"])
    assert count >= 700
    assert np.array_equal(record["ft"].y, np.arange(count) * 0.25)
    assert "recorder killed?" in record.notes[0]


def test_files_left_by_a_killed_recorder_are_not_overwritten(tmp_path):
    (tmp_path / "run.partial").mkdir()
    with BagWriter(tmp_path / "run") as bag:
        assert bag.partial == tmp_path / "run.partial1"
    assert (tmp_path / "run.partial").is_dir()


def test_a_database_that_breaks_off_gives_what_it_can(tmp_path):
    bag = write_foreign(tmp_path / "bag", run_rows(400), StoragePlugin.SQLITE3)
    file = bag / "bag.db3"
    data = file.read_bytes()
    rng = random.Random(4)
    outcomes = set()
    for cut in [len(data) * 3 // 4, *(rng.randrange(1, len(data)) for _ in range(40))]:
        file.write_bytes(data[:cut])
        try:
            notes = " ".join(read_record(bag).notes)
            assert "cut off" in notes
            outcomes.add("read")
        except BagError as error:
            assert "\n" not in str(error)
            outcomes.add("refused")
    assert outcomes == {"read", "refused"}
