"""A power cut or a failing disk under a recording: everything that was on the disk is kept."""

from threading import Event

import pytest

from msg_adapters import BagWriter, iterate
from msg_adapters.mcap_storage import McapStorage
from rsea_ros.errors import BagError

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


def test_a_disk_that_fails_under_a_recording_is_reported_and_the_rest_is_kept(tmp_path, monkeypatch):
    cut = PowerCut(monkeypatch, McapStorage)

    def break_power(storage):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(McapStorage, "sync", break_power)
    line = r"bag: cannot be written: Input/output error; .* is in .*bag.partial"
    with pytest.raises(BagError, match=line), BagWriter(tmp_path / "bag") as bag:
        for k in range(1, 9):
            cut.now = 1.1 * k
            bag.write("/a", "std_msgs/msg/Bool", k, BOOL)
    assert len(list(iterate(bag.partial))) >= 1


def test_a_disk_that_fails_at_the_last_moment_is_reported_too(tmp_path, monkeypatch):
    cut, answer = PowerCut(monkeypatch, McapStorage), Event()

    def break_power(storage):
        answer.wait()
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(McapStorage, "sync", break_power)
    line = "cannot be written: Input/output error"
    with pytest.raises(BagError, match=line), BagWriter(tmp_path / "bag") as bag:
        for k in (1, 2):
            cut.now = 1.1 * k
            bag.write("/a", "std_msgs/msg/Bool", k, BOOL)
        answer.set()
    assert len(list(iterate(bag.partial))) == 2


def test_a_recording_without_new_messages_is_flushed(tmp_path, monkeypatch):
    cut = PowerCut(monkeypatch, McapStorage)
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag") as bag:
        bag.write("/a", "std_msgs/msg/Bool", 5, BOOL)
        cut.now = 1.1
        bag.keep_up()
        assert len(list(iterate(bag.partial))) == 1
        raise RuntimeError
