"""record: no signal costs a message, and no other recording does."""

import signal

from msg_adapters import BagWriter, iterate

BOOL = bytes([0, 1, 0, 0, 1])


def ready(node):
    return any("recording into" in line for line in node.output)


def test_a_signal_completes_the_bag(start, listener, tmp_path):
    record = start("record", out=tmp_path / "bag")
    listener.until(lambda: ready(record))
    assert record.stop(signal.SIGHUP) == 0, record.output
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]
    assert list(iterate(tmp_path / "bag")) == []


def test_a_recording_that_exists_is_refused(start, tmp_path):
    with BagWriter(tmp_path / "bag.mcap") as bag:
        bag.write("/a", "std_msgs/msg/Bool", 5, BOOL)
    record = start("record", out=tmp_path / "bag.mcap")
    assert record.wait() == 2
    assert len(record.output) == 1 and "exists already, expected a new name" in record.output[0]
    assert len(list(iterate(tmp_path / "bag.mcap"))) == 1
