"""Bags that we write: other programs read them, and no partial bag gets the final name."""

import resource
from dataclasses import replace

import numpy as np
import pytest
import yaml
from foreign import run_rows, write_foreign
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader, StoragePlugin

from msg_adapters import BagWriter, TopicMap, iterate, read_record, write_record
from msg_adapters.records import write_overlay
from rsea_ros.errors import BagError, ParameterError
from rsea_ros.records.record import Channel, Record

STORAGES = ["mcap", "sqlite3"]
BOOL = bytes([0, 1, 0, 0, 1])


def assert_same(got: Record, expected: Record):
    assert set(got.channels) == set(expected.channels)
    assert got.epoch_ns == expected.epoch_ns
    for name, channel in expected.channels.items():
        assert np.array_equal(got[name].y, channel.y), name
        assert np.allclose(got[name].t, channel.t, rtol=0, atol=1e-9), name


@pytest.mark.parametrize("target", ["mcap", "sqlite3", "run.mcap", "run.db3"])
def test_a_record_comes_back(tmp_path, record, target):
    path = tmp_path / target
    write_record(record, path, storage=target if target in STORAGES else "mcap")
    assert_same(read_record(path), record)
    assert [entry.name for entry in tmp_path.iterdir()] == [target]


def test_notes_names_joint_and_axis_come_back(tmp_path, record):
    topics = TopicMap(namespace="/lab", joint="knee", axis="-force.x").with_topics(["ft=/wrist"])
    write_record(replace(record, notes=("one: with a colon", "two")), tmp_path / "bag", topics)
    got = read_record(tmp_path / "bag", topics=topics)
    assert_same(got, record)
    assert got.notes == ("one: with a colon", "two")
    with AnyReader([tmp_path / "bag"]) as reader:
        assert {c.topic for c in reader.connections} == {
            "/lab/torque_command",
            "/lab/joint_states",
            "/wrist",
            "/lab/desired_position",
        }


def test_faults_come_back_as_they_were(tmp_path, record):
    """Stamps that repeat or go back, values that are not finite, channels of one topic apart."""
    t, y = record["ft"].t.copy(), record["ft"].y.copy()
    t[300:400] -= 0.5
    t[500] = t[499]
    y[7] = np.nan
    half = Channel(record["velocity"].t[::2], record["velocity"].y[::2])
    faulty = record.with_channels(ft=Channel(t, y), velocity=half)
    write_record(faulty, tmp_path / "bag")
    got = read_record(tmp_path / "bag", strict=False)
    assert np.array_equal(got["ft"].y, y, equal_nan=True)
    assert np.allclose(got["ft"].t, t, rtol=0, atol=1e-9)
    assert np.array_equal(got["velocity"].y, half.y)
    assert np.array_equal(got["position"].y, record["position"].y)


@pytest.mark.parametrize("storage", STORAGES)
def test_rosbags_finds_everything_in_order(tmp_path, record, storage):
    write_record(record, tmp_path / "bag", storage=storage)
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 4 * 560
        assert {topic: info.msgcount for topic, info in reader.topics.items()} == {
            f"/rsea/{name}": 560 for name in ("torque_command", "joint_states", "ft", "desired_position")
        }
        assert reader.start_time == record.epoch_ns
        times = [time for _, time, _ in reader.messages(reader.connections)]
        assert times == sorted(times)
        assert reader.end_time == times[-1] + 1
    with AnyReader([tmp_path / "bag"]) as reader:  # with the definitions in the bag, no type store
        (ft,) = (c for c in reader.connections if c.topic == "/rsea/ft")
        values = [reader.deserialize(raw, c.msgtype).wrench.torque.z for c, _, raw in reader.messages([ft])]
    assert values == record["ft"].y.tolist()


def test_chunks_are_indexed_across_a_long_run(tmp_path):
    """More than one chunk: rosbags reads by the index, which must lead to every message."""
    with BagWriter(tmp_path / "bag") as bag:
        for k in range(50_000):
            bag.write("/a" if k % 3 else "/b", "std_msgs/msg/Bool", 10**18 + k, BOOL)
    with Reader(tmp_path / "bag") as reader:
        assert sum(1 for _ in reader.messages(reader.connections, start=10**18 + 30_000)) == 20_000
        assert {name: info.msgcount for name, info in reader.topics.items()} == {"/a": 33_333, "/b": 16_667}


@pytest.mark.parametrize(
    ("storage", "plugin"), [("mcap", StoragePlugin.MCAP), ("sqlite3", StoragePlugin.SQLITE3)]
)
def test_metadata_equal_those_of_rosbags(tmp_path, storage, plugin):
    theirs = write_foreign(tmp_path / "theirs" / "bag", run_rows(5), plugin)
    with BagWriter(tmp_path / "bag", storage) as bag:
        for topic, kind, log_time, raw in iterate(theirs):
            bag.write(topic, kind, log_time, raw)
    known, expected = (
        yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        for path in (tmp_path / "bag", theirs)
    )
    assert known.pop("ros_distro") == "rsea_ros"
    expected.pop("ros_distro")
    assert known == expected
    assert list(iterate(tmp_path / "bag")) == list(iterate(theirs))


BAD_TOPICS = {
    "a blank": TopicMap(namespace="a b"),
    "a digit first": TopicMap(namespace="1abc"),
    "a minus": TopicMap().with_topics(["ft=left-wrist"]),
    "a letter of another alphabet": TopicMap(namespace="\N{GREEK SMALL LETTER OMEGA}"),
    "a slash at the end": TopicMap().with_topics(["ft=/wrist/"]),
    "a tilde": TopicMap(namespace="~bench"),
    "too many letters": TopicMap(namespace="n" * 250),
    "two types": TopicMap().with_topics(["ft=torque_command"]),
    "two roles": TopicMap().with_topics(["joint_states=torque_command"]),
}


@pytest.mark.parametrize("name", BAD_TOPICS)
def test_a_topic_that_ros_cannot_have_is_not_written(tmp_path, record, name):
    says = r"^topic .*/.*: is (not a name of ROS, expected|both \w+ and \w+, expected)"
    with pytest.raises(BagError, match=says):
        write_record(record, tmp_path / "bag", BAD_TOPICS[name])
    assert list(tmp_path.iterdir()) == []


def test_a_recording_has_one_type_for_each_topic(tmp_path):
    says = "/a: is std_msgs/msg/Bool and std_msgs/msg/Int8, expected one type"
    with pytest.raises(BagError, match=says), BagWriter(tmp_path / "bag", recording=False) as bag:
        for kind in ("Bool", "Int8"):
            bag.write("/a", f"std_msgs/msg/{kind}", 1, BOOL)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("field", ["namespace", "ft", "joint"])
@pytest.mark.parametrize("name", ["a\0b", "a\nb"])
def test_a_name_that_cannot_be_printed_is_refused(field, name):
    with pytest.raises(ParameterError, match=f"^{field} 'a.+b': cannot be printed, expected a name of ROS"):
        TopicMap(**{field: name})


def test_an_overlay_of_stamps_before_1970_begins_there(tmp_path, record):
    early = replace(record, epoch_ns=-(10**18))
    write_overlay({"/rsea": early, "/simulated": early}, tmp_path / "overlay.mcap")
    for namespace in ("/rsea", "/simulated"):
        got = read_record(tmp_path / "overlay.mcap", topics=TopicMap(namespace=namespace))
        assert_same(got, replace(record, epoch_ns=0))


def test_a_taken_name_is_refused_before_anything_is_written(tmp_path, record):
    write_record(record, tmp_path / "bag")
    with pytest.raises(BagError, match="bag: exists already, expected a new name"):
        write_record(record, tmp_path / "bag")
    with pytest.raises(BagError, match="storage 'tape', expected one of mcap, sqlite3"):
        write_record(record, tmp_path / "other", storage="tape")
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("target", ["run.mcap", "run.db3", "run"])
def test_a_bag_is_replaced_only_by_force_and_only_by_a_complete_one(tmp_path, record, target):
    path = tmp_path / target
    write_record(record, path)
    with pytest.raises(BagError, match=f"{target}: exists already, expected a new name"):
        write_record(record.between(0.0, 1.0), path)
    with pytest.raises(ZeroDivisionError), BagWriter(path, recording=False, force=True):
        raise ZeroDivisionError
    assert_same(read_record(path), record)
    write_record(record.between(0.0, 1.0), path, force=True)
    assert_same(read_record(path), record.between(0.0, 1.0))
    assert [entry.name for entry in tmp_path.iterdir()] == [target]


def test_a_name_that_is_taken_while_the_bag_is_written_is_not_replaced(tmp_path):
    for name in ("run.mcap", "run"):
        with pytest.raises(BagError, match="exists already"), BagWriter(tmp_path / name) as bag:
            bag.write("/a", "std_msgs/msg/Bool", 5, BOOL)
            (tmp_path / name).write_text("another's")
        assert (tmp_path / name).read_text() == "another's"
        assert len(list(iterate(bag.partial))) == 1


def test_a_folder_that_holds_more_than_a_bag_is_never_replaced(tmp_path, record):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "thesis.tex").touch()
    with pytest.raises(BagError, match="bag: holds more than a bag, expected a new name"):
        write_record(record, tmp_path / "bag", force=True)


@pytest.mark.parametrize("recording", [True, False])
@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_a_failure_leaves_a_recording_and_no_result(tmp_path, recording, error):
    with pytest.raises(error), BagWriter(tmp_path / "bag", recording=recording) as bag:
        bag.write("/a", "std_msgs/msg/Bool", 5, BOOL)
        bag.flush()
        raise error
    left = [entry.name for entry in tmp_path.iterdir()]
    expected = {(True, RuntimeError): ["bag.partial"], (True, KeyboardInterrupt): ["bag"]}
    assert left == expected.get((recording, error), [])
    for name in left:
        assert len(list(iterate(tmp_path / name))) == 1


@pytest.fixture
def full_disk():
    """A limit on the size of files stands in for the full disk: the write fails half-way just the same."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_500_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(("storage", "recording"), [("mcap", True), ("sqlite3", False)])
def test_a_full_disk_is_one_error_and_loses_nothing_recorded(tmp_path, full_disk, storage, recording):
    says = f"^{tmp_path}/bag: cannot be written: .*{f'is in {tmp_path}/bag.partial' if recording else ''}"
    bag = BagWriter(tmp_path / "bag", storage, recording=recording)
    with pytest.raises(BagError, match=says), bag:
        for k in range(100_000):
            bag.write("/a", "std_msgs/msg/Bool", 10**18 + k, BOOL)
            if k % 10_000 == 0:
                bag.flush()
    assert [path.name for path in tmp_path.iterdir()] == (["bag.partial"] if recording else [])
    assert not recording or len(list(iterate(tmp_path / "bag.partial"))) >= 10_000


@pytest.mark.parametrize(
    ("first", "value"), [(-3.0, "-3"), (2.0**31, r"2.14748e\+09"), (np.nan, "nan"), (np.inf, "inf")]
)
def test_stamps_that_no_header_can_hold_are_refused_in_one_line(tmp_path, first, value):
    stamped = Record({"ft": Channel(first + np.arange(4.0), np.zeros(4))}, source="run")
    with pytest.raises(BagError, match=f"run: ft: stamp 0 is {value} s since 1970, expected 0 to 2147483648"):
        write_record(stamped, tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_batches_make_no_difference(tmp_path, monkeypatch):
    rng = np.random.default_rng(4)
    t = np.round(np.cumsum(rng.uniform(0, 0.02, 100)), 2)  # stamps repeat, and coincide with others
    slow = t[::3].copy()
    slow[10:12] = slow[11], slow[10]
    channels = {"command": Channel(t, t), "ft": Channel(slow, slow), "position": Channel(t + 1.0, t)}
    record = Record(channels, epoch_ns=10**9)
    write_record(record, tmp_path / "whole.mcap")
    monkeypatch.setattr("msg_adapters.records.BATCH", 7)
    write_record(record, tmp_path / "parts.mcap")
    assert (tmp_path / "parts.mcap").read_bytes() == (tmp_path / "whole.mcap").read_bytes()
    assert len(list(iterate(tmp_path / "parts.mcap"))) == 100 + 34 + 100
