"""Bags that are refused in one line, and hostile ones: nothing is expanded, run or allocated unchecked."""

import numpy as np
import pytest
from foreign import EPOCH, joint_state, raw_of, run_rows, spoilt_database, write_foreign
from mcap_bytes import PACK, McapFile, chunk, write

from msg_adapters import TopicMap, cdr, compression, read_record, reading, sqlite_file
from msg_adapters.bags import read_contents
from rsea_ros.errors import BagError, ParameterError


def _without(topic):
    return [row for row in run_rows(4) if row[0] != topic]


def _change(index, message):
    rows = run_rows(4)
    rows[index] = (rows[index][0], rows[index][1], message)
    return rows


def _wrong_type():
    at = EPOCH
    return [*_without("/rsea/ft"), ("/rsea/ft", at, joint_state(at, effort=[1.0]))]


STATE = joint_state(EPOCH + 3_572_428, position=[0.1], velocity=[np.nan], effort=[0.3])
COMMAND = joint_state(EPOCH + 3_571_428, effort=[np.nan])
REFUSED = {
    "no command": (
        _without("/rsea/torque_command"),
        r"no message on /rsea/torque_command; the bag holds /rsea/ft \(",
    ),
    "no measurement": (run_rows(4)[::3], "no message on /rsea/joint_states or /rsea/ft; the bag holds"),
    "wrong type": (
        _wrong_type(),
        "/rsea/ft is sensor_msgs/msg/JointState, expected geometry_msgs/msg/WrenchStamped",
    ),
    "empty bag": ([], "no message on /rsea/torque_command; the bag holds no topic at all"),
    "NaN": (
        _change(3, COMMAND),
        r"/rsea/torque_command effort\[1\] is nan at 1763000000.127028217 s, expected a finite",
    ),
    "two joints": (
        _change(1, joint_state(EPOCH, ["hip", "knee"], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0])),
        r"/rsea/joint_states: 3 joints \(joint, hip, knee\), expected one; name it with --joint",
    ),
    "joints without names": (
        _change(1, joint_state(EPOCH, [], [0.0, 1.0])),
        r"2 joints \(joint\), expected one",
    ),
    "empty command": (
        [(name, at, joint_state(at) if "command" in name else m) for name, at, m in run_rows(4)],
        "the command's messages hold no effort, expected the torque in N·m",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_bag_is_refused_in_one_line(tmp_path, case):
    rows, text = REFUSED[case]
    bag = write_foreign(tmp_path / "bag", rows)
    with pytest.raises(BagError, match=text) as caught:
        read_record(bag)
    assert str(caught.value).startswith(str(bag))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("case", ["no command", "no measurement", "NaN"])
def test_faults_are_returned_where_a_diagnosis_asks_for_them(tmp_path, case):
    rows, _ = REFUSED[case]
    record = read_record(write_foreign(tmp_path / "bag", rows), strict=False)
    for name, count in (
        ("ft", "/rsea/ft"),
        ("command", "/rsea/torque_command"),
        ("velocity", "/rsea/joint_states"),
    ):
        expected = sum(topic == count for topic, _, _ in rows)
        assert len(record[name]) == expected if expected else name not in record
    if case == "NaN":
        assert np.isnan(record["command"].y[1])


@pytest.mark.parametrize("strict", [True, False])
def test_a_measurement_that_is_nan_stays_for_the_checks_to_mask(tmp_path, strict):
    record = read_record(write_foreign(tmp_path / "bag", _change(4, STATE)), strict=strict)
    assert np.isnan(record["velocity"].y).tolist() == [False, True, False, False]


def test_repeated_stamps_are_dropped_with_a_note_or_kept(tmp_path):
    bag = write_foreign(tmp_path / "bag", [*run_rows(4), *run_rows(4)[-1:]])
    record = read_record(bag)
    assert len(record["ft"]) == 4
    assert [(f.kind, f.channel) for f in record.faults] == [("duplicate_stamps", "ft")]
    assert record.notes == (f"{bag}: /rsea/ft wrench: 1 of 5 stamps repeat, the first of each kept",)
    assert len(read_record(bag, strict=False)["ft"]) == 5


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.mcap", b"", "empty file"),
        ("a.mcap", b"nothing of the kind", "no MCAP file, expected it to start with"),
        (
            "a.mcap",
            b"\x89MCAP0\r\n",
            r"no message on /rsea/torque_command; the bag holds no topic at all \(.*cut off",
        ),
        ("a.db3", b"nothing of the kind", "no sqlite3 file"),
        ("a.db3", b"SQLite format 3\x00" + bytes(200), "no rosbag2 database"),
        ("a.csv", b"1,2", "no bag, expected a directory, or a .mcap, .db3 or .bag file"),
        ("a.mcap.zstd", b"nothing of the kind", "Unable to decompress|Unknown frame|decompress"),
    ],
)
def test_files_that_are_not_bags_are_refused(tmp_path, name, content, text):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(BagError, match=text) as caught:
        read_record(file)
    assert str(caught.value).startswith(str(file))


def test_directories_that_are_not_bags_are_refused(tmp_path):
    with pytest.raises(BagError, match="no bag, expected a directory with"):
        read_record(tmp_path)
    with pytest.raises(BagError, match="no such bag"):
        read_record(tmp_path / "nothing")
    bag = write_foreign(tmp_path / "bag", run_rows(4))
    (bag / "bag.mcap").rename(bag / "other.mcap")
    with pytest.raises(BagError, match=r"metadata.yaml: names bag.mcap, which is not there"):
        read_record(bag)


def test_senseless_topic_options_are_refused():
    with pytest.raises(ParameterError, match="axis 'yaw': expected one of"):
        TopicMap(axis="yaw")
    with pytest.raises(
        ParameterError, match="topic 'wrench=/ft': expected ROLE=TOPIC with ROLE one of torque_command"
    ):
        TopicMap().with_topics(["wrench=/ft"])


@pytest.fixture
def ceiling(monkeypatch):
    """Make bombs small: no slack, ten times the packed size."""
    monkeypatch.setattr(compression, "SLACK", 100_000)
    monkeypatch.setattr(compression, "RATIO", 10)


@pytest.mark.parametrize("how", ["zstd", "lz4"])
@pytest.mark.parametrize("declared", [2_000_000, 1000])
def test_a_chunk_that_unpacks_to_too_much_is_left_out(tmp_path, ceiling, how, declared):
    """More than the allowance, and more than it declares."""
    bomb = chunk(b"", declared=declared, how=how, packed=PACK[how](bytes(2_000_000)), checksum=0)
    file = McapFile()
    got = read_record(write(tmp_path / "a.mcap", file.file([*file.data(), bomb])))
    assert len(got["ft"]) == 60
    (fault,) = got.faults
    assert (fault.kind, fault.size) == ("damaged_chunks", 1)
    assert "unpacks to more than" in fault.detail


@pytest.mark.parametrize("how", ["zstd", "lz4"])
def test_a_chunk_that_breaks_off_or_goes_on_is_left_out(tmp_path, how):
    file = McapFile()
    inner = b"".join(file.messages[:30])
    short = chunk(inner, how=how, packed=PACK[how](inner)[:-20])
    longer = chunk(inner, how=how, packed=PACK[how](inner), declared=len(inner) + 10**12)
    got = read_record(write(tmp_path / "a.mcap", file.file([*file.data(), short, longer])))
    assert [(f.kind, f.size) for f in got.faults] == [("damaged_chunks", 2)]


def test_packed_messages_and_files_have_the_same_allowance(tmp_path, ceiling):
    bomb = PACK["zstd"](bytes(3_000_000))
    file = McapFile(encode=lambda k, row: bomb)
    with pytest.raises(BagError, match="no message on"):
        read_record(write(tmp_path / "a.mcap", file.file()))
    with pytest.raises(BagError, match="unpacks to more than"):
        read_contents(write(tmp_path / "b.mcap.zstd", bomb))


HOSTILE = {
    "view": (
        "ALTER TABLE messages RENAME TO kept",
        "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n)"
        " SELECT 1 AS topic_id, 1 AS timestamp, zeroblob(1000000000) AS data FROM n",
    ),
    "view of topics": ("ALTER TABLE topics RENAME TO kept", "CREATE VIEW topics AS SELECT * FROM kept"),
    "generated column": (
        "DROP TABLE messages",
        "CREATE TABLE messages(topic_id INTEGER, timestamp INTEGER,"
        " data BLOB GENERATED ALWAYS AS (zeroblob(1000000000)))",
        "INSERT INTO messages(topic_id, timestamp) VALUES (1, 1)",
    ),
    "no such table": ("DROP TABLE messages",),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_database_with_a_program_of_its_own_is_refused(tmp_path, case):
    with pytest.raises(BagError, match=r"expected a plain table|no plain column"):
        read_record(spoilt_database(tmp_path / "bag", *HOSTILE[case]))


def test_a_query_is_ended_after_its_time(tmp_path, monkeypatch):
    bag = spoilt_database(tmp_path / "bag")
    monkeypatch.setattr(sqlite_file, "_STEPS", 10)
    monkeypatch.setattr(sqlite_file, "_STEPS_AT_LEAST", 700)
    monkeypatch.setattr(sqlite_file, "_STEPS_PER_BYTE", 0)
    got = read_contents(bag)
    assert [f.kind for f in got.faults if f.channel == "bag.db3"] == ["cut_off"]
    assert any("interrupted" in f.detail for f in got.faults)


def _metadata(tmp_path, text: bytes):
    bag = write_foreign(tmp_path / "bag", run_rows(60))
    (bag / "metadata.yaml").write_bytes(text)
    return bag


BOMB = b"a: &a [x]\n" + b"".join(
    f"{b}: &{b} [*{a}, *{a}]\n".encode() for a, b in zip("abcdefg", "bcdefgh", strict=True)
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"x: " + b"y" * 1_000_001, "more than 1000000 bytes"),
        (BOMB, r"has an alias \(\*a\), expected none"),
        (b"[" * 5000, "nested more than 30 deep"),
        (b"{a: " * 900 + b"1" + b"}" * 900, "nested more than 30 deep"),
    ],
)
def test_impossible_metadata_are_refused(tmp_path, text, expected):
    with pytest.raises(BagError, match=expected) as caught:
        read_record(_metadata(tmp_path, text))
    assert "\n" not in str(caught.value)


ROOT = b"rosbag2_bagfile_information:"


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"- 1\n- 2\n",
        b"2020-13-45",
        ROOT + b" 5",
        ROOT + b" {relative_file_paths: {a: b}}",
        ROOT + b" {relative_file_paths: [[a]], topics_with_message_count: []}",
        ROOT + b' {relative_file_paths: ["bag\\0.mcap"], topics_with_message_count: []}',
        ROOT + b" {relative_file_paths: [bag.mcap], topics_with_message_count: [2001-01-01]}",
        ROOT + b" {relative_file_paths: [bag.mcap], topics_with_message_count:"
        b" [{topic_metadata: {name: /a}, message_count: 2001-01-01}]}",
        b"\xff\xfe\x00",
        b"!!python/object/apply:os.system [x]: [",
    ],
)
def test_metadata_that_are_not_understood_are_reported_and_the_files_read(tmp_path, text):
    got = read_record(_metadata(tmp_path, text))
    assert len(got["ft"]) == 60
    assert [(f.kind, f.channel) for f in got.faults] == [("damaged_metadata", "metadata.yaml")]


def test_messages_that_all_differ_in_layout_are_sorted_once(monkeypatch):
    """Comparing each layout with all that is left takes the square of their number."""
    raw = [raw_of(joint_state(k, [f"j{k:05}"], effort=[1.0])) for k in range(400)]
    compared = []
    whole = cdr.np.zeros
    monkeypatch.setattr(cdr.np, "zeros", lambda n, *kind: compared.append(n) or whole(n, *kind))
    blocks = list(cdr.blocks(raw, "sensor_msgs/msg/JointState", "here"))
    assert sorted(int(row) for block in blocks for row in block.rows) == list(range(400))
    assert sum(compared) <= 400 * 32


def test_a_bag_beyond_the_memory_is_refused_in_one_line(tmp_path, monkeypatch):
    """12 million messages of ten minutes at 8 kHz ended in the last net."""

    def full(*arguments, **options):
        raise MemoryError

    bag = write(tmp_path / "a.mcap", McapFile().file())
    monkeypatch.setattr(reading, "record_from", full)
    with pytest.raises(BagError, match=r"a\.mcap: needs more memory than .*: split it, or record fewer"):
        read_record(bag)
