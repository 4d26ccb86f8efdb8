"""Tables as strangers write them: joined streams, counters that begin anew, rows out of order, `%time`."""

import numpy as np
import pytest

from msg_adapters.tables import guess_map, import_record, load_map
from rsea_ros.cli.maps import map_path
from rsea_ros.errors import ImportMapError

MAP = """time: {column: t, unit: s}
channels:
  command: {column: u, unit: N m}
  position: {column: q, unit: rad}
  ft: {column: f, unit: N m}
"""
ROWS = 2000
T = 0.002 * np.arange(ROWS)
RNG = np.random.default_rng(1801)
COMMAND, POSITION = np.cumsum(RNG.normal(size=ROWS)), np.sin(3.0 * T) + 1e-4 * RNG.normal(size=ROWS)
FT = np.cos(3.0 * T)


def table(t, *columns):
    """Return rows of a table with empty cells where there is no number."""
    cells = ([f"{s:.9f}", *("" if np.isnan(v) else f"{v:.8g}" for v in values)] for s, *values in
             zip(t, *columns, strict=True))  # fmt: skip
    return "t,u,q,f\n" + "\n".join(map(",".join, cells)) + "\n"


def put(stamps, every, values):
    """Return a column of a joined table: values at its own stamps, empty cells in all other rows."""
    column = np.full(len(every), np.nan)
    column[np.searchsorted(every, stamps)] = values
    return column


def test_empty_cells_in_rows_of_another_stream_are_no_missing_values(files):
    """Five red lines, `missing values 89 %`, of a joined log in which nothing was missing."""
    own = [np.round(t, 6) for t in (0.01 * np.arange(400), T + 3e-4, np.arange(1200) / 312 + 1.1e-3)]
    every = np.unique(np.concatenate(own))
    columns = [put(s, every, np.cos(s)) for s in own]
    record = files(MAP, table(every, *columns))
    assert not record.faults
    assert any(note == "3 streams, each in rows of its own: command; position; ft" for note in record.notes)
    for stamps, name in zip(own, ("command", "position", "ft"), strict=True):
        assert np.allclose(record[name].t, stamps, atol=1e-9)


def test_streams_with_the_same_printed_stamp_repeat_none(files):
    """PlotJuggler prints microseconds: two rows of two streams may have one stamp, and were spread apart."""
    every = np.repeat(T, 2)
    u, q = np.repeat(COMMAND, 2), np.repeat(FT, 2)
    u[1::2], q[::2] = np.nan, np.nan
    record = files(MAP, table(every, u, q, q))
    assert not record.faults
    assert np.allclose(record["command"].t, T) and np.allclose(record["position"].t, T)


LOST = RNG.random((3, ROWS))
SPARSE = np.where(np.arange(ROWS) % 5 == 0, COMMAND, np.nan)


@pytest.mark.parametrize(
    ("command", "count", "whole"),
    [
        (np.where(LOST[0] < 0.1, np.nan, COMMAND), np.sum(LOST[0] < 0.1), ROWS),
        (np.where(LOST[1] < 0.5, np.nan, COMMAND), np.sum(LOST[1] < 0.5), ROWS),
        (np.where(LOST[2] < 0.9, np.nan, COMMAND), np.sum(LOST[2] < 0.9), ROWS),
        (np.where(T < 2.0, COMMAND, np.nan), 998, 1998),  # it stops halfway
        (SPARSE, 0, 400),  # a slower stream in rows of a faster one
        (np.where((T < 1.0) | (T > 1.2), SPARSE, np.nan), 20, 399),
        (np.where(T < 2.0, SPARSE, np.nan), 199, 399),
    ],
)
def test_cells_that_a_column_lacks_among_its_own_rows_are_told(files, command, count, whole):
    record = files(MAP, table(T, command, POSITION, FT))
    told = {f.channel: f for f in record.faults}
    assert set(told) == ({"command"} if count else set())
    if count:
        assert told["command"].kind == "missing_values"
        assert told["command"].detail.startswith(f"{count} of {whole} values of u are missing, the first at ")


@pytest.mark.parametrize(
    ("unit", "span", "first"),
    [
        ("s", 65.536, 64.0), ("ms", 65536, 64_000), ("s", 4294.967296, 4293.0), ("us", 2**32, 2**32 - 1e6),
        ("s", 0.065536, 0.0),
    ],
)  # fmt: skip
def test_a_counter_that_begins_anew_is_unwrapped(files, unit, span, first):
    stamps = np.round((first + T / {"s": 1.0, "ms": 1e-3, "us": 1e-6}[unit]) % span, 9)
    record = files(MAP.replace("unit: s", f"unit: {unit}"), table(stamps, COMMAND, POSITION, FT))
    assert np.allclose(record["ft"].t, T, atol=1e-8) and not record.faults
    assert any(f"t begins anew at {span:.10g}, as a counter does" in note for note in record.notes)


@pytest.mark.parametrize("back", [4.0, 3.0, 1.0])
def test_two_runs_in_a_file_are_refused_with_what_to_do(files, back):
    text = table(np.r_[T, T + 4.0 - back], *(np.r_[y, y] for y in (COMMAND, POSITION, FT)))
    with pytest.raises(ImportMapError) as refused:
        files(MAP, text)
    for words in ("t of row 2001 goes back", "make a file of the rows from 2001 on, or name the column that"):
        assert words in str(refused.value)


def test_rows_that_swapped_are_sorted_where_their_values_agree(files, tmp_path):
    k = np.arange(ROWS)
    k[[700, 701]] = 701, 700
    record = files(MAP, table(T[k], COMMAND[k], POSITION[k], FT[k]))
    assert np.allclose(record["position"].y, POSITION) and np.allclose(record["position"].t, T)
    (fault,) = record.faults
    assert (fault.kind, fault.detail) == (
        "out_of_order", "1 of 2000 stamps go back, the first at 1.4 s: rows sorted by them",
    )  # fmt: skip
    record = files(MAP, table(T[k], COMMAND, POSITION, FT))  # the stamps alone: a clock that was corrected
    assert np.allclose(record["position"].y, POSITION) and np.allclose(record["position"].t, T)
    assert record.faults[0].detail.endswith("the stamps alone are sorted, the values are in order")


NS = 17 * 10**17 + 5_000_000 * np.arange(60)
ECHO = "%time,field.header.stamp,field.header.frame_id,field.name0,field.position0,field.effort0\n" + "".join(
    f"{ns},{ns - 400},base,knee,{np.sin(ns % 10**9 / 4e7):.6f},{np.cos(ns % 10**9 / 3e7):.6f}\n" for ns in NS
)


@pytest.mark.parametrize("time", ["time", '"%time"', "field.header.stamp"])
def test_names_that_rostopic_echo_writes_behind_a_percent_sign_are_read(files, time):
    record = files(
        f"time: {{column: {time}, unit: ns}}\nchannels:\n  position: {{column: field.position0, unit: rad}}\n"
        "  command: {column: field.effort0, unit: N m}\n", ECHO,
    )  # fmt: skip
    assert len(record["position"]) == 60 and not record.faults
    assert np.allclose(record["position"].t, 5e-3 * np.arange(60), atol=1e-6)


def test_a_guess_knows_them_and_a_counter(tmp_path):
    (tmp_path / "echo.csv").write_text(ECHO)
    text = guess_map(tmp_path / "echo.csv")
    assert "time: {column: time, unit: ns}  # 200 Hz" in text
    assert 'position: {column: "field.position0"' in text and "field.header.stamp\", unit: A" not in text
    stamps = (64_000 + np.arange(ROWS) * 2) % 65536
    (tmp_path / "ticks.csv").write_text(table(stamps, COMMAND, POSITION, FT))
    assert "time: {column: t, unit: ms}  # 500 Hz" in guess_map(tmp_path / "ticks.csv")


def test_what_ros2_topic_echo_writes_is_read_by_its_map(tmp_path):
    values = ((5_000_000 * k, np.sin(k / 9), np.cos(k / 7)) for k in range(60))
    lines = (f"1700000000,{ns},base,knee,{q:.6f},0.1,{effort:.6f}" for ns, q, effort in values)
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    record = import_record(tmp_path / "run.csv", load_map(map_path("joint_states_echo")))
    assert len(record["position"]) == 60 and not record.faults
