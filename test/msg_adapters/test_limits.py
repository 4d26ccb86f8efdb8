"""Limits for hostile files: declared sizes are enforced, nothing is expanded, run or allocated unchecked."""

from __future__ import annotations

import pytest
from foreign import joint_state, raw_of, run_rows, spoilt_database, write_foreign
from mcap_bytes import PACK, McapFile, chunk, write

from msg_adapters import cdr, compression, read_record, reading, sqlite_file
from msg_adapters.bags import read_contents
from rsea_ros.errors import BagError


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
