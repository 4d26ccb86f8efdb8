"""Recordings that broke off, by a kill or a power cut: what is complete comes back, with a note."""

import os
import random
import signal
from threading import Event

import numpy as np
import pytest
from bad_input import forked
from foreign import JOINT_STATE, WRENCH, run_rows, write_foreign
from mcap_bytes import CHUNK_ROWS, McapFile, write
from rosbags.rosbag2 import StoragePlugin

from msg_adapters import BagWriter, iterate, read_record
from msg_adapters.bags import read_contents
from msg_adapters.cdr import joint_states, wrenches
from msg_adapters.mcap_storage import McapStorage
from rsea_ros.errors import BagError


@pytest.mark.parametrize("how", ["", "zstd"])
def test_every_complete_chunk_before_the_cut_comes_back(tmp_path, how):
    whole = McapFile(run_rows(120), how=how)
    parts = whole.data()
    data = whole.file(parts)
    begin = data.index(parts[0])
    ends = begin + np.cumsum([len(part) for part in parts])
    rng, recovered = random.Random(20), []
    for cut in [*(rng.randrange(1, ends[-1]) for _ in range(150)), ends[-1]]:
        file = write(tmp_path / "cut.mcap", data[:cut])
        try:
            contents = read_contents(file)
        except BagError as error:
            assert cut < 8
            assert "no MCAP file" in str(error)
            continue
        got = sum(len(messages.raw) for messages in contents.topics.values())
        complete = CHUNK_ROWS * np.count_nonzero(ends <= cut)
        assert complete <= got <= complete + CHUNK_ROWS
        assert "cut off" in contents.notes[0]
        recovered.append(got)
    assert max(recovered) == 360
    assert len(set(recovered)) > 5


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_killed_recorder_leaves_a_bag_that_opens(tmp_path, storage):
    def record_and_die():
        with BagWriter(tmp_path / "run", storage) as bag:
            for k in range(800):
                stamps = np.array([1_763_000_000_000_000_000 + k * 3_571_428])
                (command,) = joint_states(stamps, "joint", effort=np.array([k * 0.5]))
                (ft,) = wrenches(stamps, np.full((1, 6), k * 0.25))
                bag.write("/rsea/torque_command", JOINT_STATE, int(stamps[0]), command)
                bag.write("/rsea/ft", WRENCH, int(stamps[0]), ft)
                if k == 700:
                    bag.flush()
            os.kill(os.getpid(), signal.SIGKILL)

    assert forked(record_and_die) == -signal.SIGKILL
    assert not (tmp_path / "run").exists()
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


BOOL = bytes([0, 1, 0, 0, 1])


class PowerCut:
    """The clock of a recording, and the part of its file that is on the disk."""

    def __init__(self, monkeypatch, storage):
        self.now, self.safe = 0.0, 0
        monkeypatch.setattr("msg_adapters.writing.time.monotonic", lambda: self.now)
        self._sync = storage.sync

    def sync(self, storage):
        """Note how long the file was when it was last synchronised."""
        self.safe = storage.path.stat().st_size
        self._sync(storage)


@pytest.mark.parametrize("interval", [0.5, 2.0])
def test_a_power_cut_loses_one_interval_at_most(tmp_path, monkeypatch, interval):
    cut = PowerCut(monkeypatch, McapStorage)
    monkeypatch.setattr(McapStorage, "sync", lambda storage: cut.sync(storage))
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag", interval=interval) as bag:
        for k in range(1, 1000):
            bag.write("/a", "std_msgs/msg/Bool", k, BOOL)
            cut.now = 0.01 * k
            bag._syncing.result()
        raise RuntimeError
    (file,) = bag.partial.iterdir()
    file.write_bytes(file.read_bytes()[: cut.safe])
    kept = [at for _, _, at, _ in iterate(bag.partial)]
    assert kept == list(range(1, len(kept) + 1))
    assert 0.01 * (999 - len(kept)) <= interval + 0.02


@pytest.mark.parametrize(("messages", "late"), [(8, False), (2, True)])
def test_a_disk_that_fails_is_reported_and_the_rest_is_kept(tmp_path, monkeypatch, messages, late):
    """late: it fails after the last message, when the bag was called complete."""
    cut, answer = PowerCut(monkeypatch, McapStorage), Event()

    def break_power(storage):
        assert not late or answer.wait(30.0)
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(McapStorage, "sync", break_power)
    line = r"bag: cannot be written: Input/output error; .* is in .*bag.partial"
    with pytest.raises(BagError, match=line), BagWriter(tmp_path / "bag") as bag:
        for k in range(1, messages + 1):
            cut.now = 1.1 * k
            bag.write("/a", "std_msgs/msg/Bool", k, BOOL)
        answer.set()
    kept = len(list(iterate(bag.partial)))
    assert kept == messages if late else kept >= 1


def test_a_recording_without_new_messages_is_flushed(tmp_path, monkeypatch):
    cut = PowerCut(monkeypatch, McapStorage)
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag") as bag:
        bag.write("/a", "std_msgs/msg/Bool", 5, BOOL)
        cut.now = 1.1
        bag.keep_up()
        assert len(list(iterate(bag.partial))) == 1
        raise RuntimeError
