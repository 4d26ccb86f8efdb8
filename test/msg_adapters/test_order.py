"""Messages out of order in the log are sorted by their stamps, unless a clock has jumped."""

import numpy as np
import pytest
from foreign import EPOCH, run_rows, wrench, write_foreign
from mcap_bytes import McapFile, write

from msg_adapters import read_record, write_record
from rsea_ros.errors import BagError
from rsea_ros.records.record import Channel
from rsea_ros.records.stamps import repair_stamps

COUNT = 400
PERIOD = 3_571_428


def _jitter(rows, share, seed=5):
    """Return rows in the order in which they arrive after a delay of up to `share` periods, or spread so."""
    rng = np.random.default_rng(seed)
    delays = np.abs(rng.normal(0.0, share * PERIOD, len(rows)))
    arrived = [(name, at + int(d), message) for (name, at, message), d in zip(rows, delays, strict=True)]
    return sorted(arrived, key=lambda row: row[1])


@pytest.mark.parametrize(("strict", "share"), [(True, 0.5), (False, 3.0)])
def test_jitter_of_arrival_changes_nothing(tmp_path, strict, share):
    rows = run_rows(COUNT)
    clean = read_record(write(tmp_path / "clean.mcap", McapFile(rows).file()), strict=strict)
    got = read_record(write(tmp_path / "a.mcap", McapFile(_jitter(rows, share)).file()), strict=strict)
    assert got.epoch_ns == clean.epoch_ns
    for name, channel in clean.channels.items():
        assert np.array_equal(got[name].t, channel.t) and np.array_equal(got[name].y, channel.y)
    assert {fault.kind for fault in got.faults} == {"out_of_order"}
    assert {fault.channel for fault in got.faults} == set(clean.channels)
    assert all(fault.size and 0.0 < fault.share < 1.0 for fault in got.faults)


def test_files_of_a_run_come_in_the_order_of_their_log_times(tmp_path):
    rows = run_rows(COUNT)
    first = write(tmp_path / "z.mcap", McapFile(rows[:600]).file())
    second = write(tmp_path / "a.mcap", McapFile(rows[600:]).file())
    got = read_record([second, first])
    assert np.array_equal(got["ft"].y, np.arange(COUNT) * 0.7)
    assert got.faults == ()


@pytest.mark.parametrize("seconds", [-0.5, 0.5, -86400.0 * 4000])
def test_a_clock_that_jumped_is_corrected_where_a_model_is_fitted(tmp_path, record, seconds):
    """The log times of this bag do not help: they are copies of the stamps."""
    t, y = record["ft"].t.copy(), record["ft"].y
    t[300:] += seconds
    write_record(record.with_channels(ft=Channel(t, y)), tmp_path / "bag")
    got = read_record(tmp_path / "bag")
    assert [(f.kind, f.channel) for f in got.faults] == [("clock_jump", "ft")]
    assert got.faults[0].size == pytest.approx(abs(seconds), abs=1e-5)
    assert np.array_equal(got["ft"].y, y)
    assert np.allclose(np.diff(got["ft"].t), 1 / 280, atol=1e-5)
    raw = read_record(tmp_path / "bag", strict=False)
    assert np.allclose(np.diff(raw["ft"].t), np.diff(t), atol=1e-5) and raw.faults == ()
    assert [f.kind for f in repair_stamps(raw)[1]] == ["clock_jump"]


@pytest.mark.parametrize(
    ("at", "stamp"), [(0, 17.0), (150, 0.25 + EPOCH * 1e-9), (COUNT - 1, 2.0**31 - 1), (150, -(2.0**31))]
)
def test_a_sample_with_a_damaged_stamp_is_left_out(tmp_path, at, stamp):
    """A bit of the seconds is wrong: no grid may be laid over the years in between."""
    rows = run_rows(COUNT)
    wrong = round(stamp * 1e9)
    message = wrench(0, [0.0] * 5 + [99.0])
    message.header.stamp.sec, message.header.stamp.nanosec = wrong // 10**9, wrong % 10**9
    rows[3 * at + 2] = ("/rsea/ft", rows[3 * at + 2][1], message)
    got = read_record(write(tmp_path / "a.mcap", McapFile(rows).file()))
    assert 99.0 not in got["ft"].y and len(got["ft"]) == COUNT - 1
    assert ("stray_stamps", "ft", 1) in {(f.kind, f.channel, f.size) for f in got.faults}
    assert got.stop - got.start < 2.0


def test_gaps_are_reported_where_a_model_is_fitted(tmp_path):
    rows = [row for k, row in enumerate(run_rows(COUNT)) if not (row[0] == "/rsea/ft" and 300 <= k < 360)]
    got = read_record(write_foreign(tmp_path / "bag", rows))
    (fault,) = got.faults
    assert (fault.kind, fault.channel, fault.size) == ("dropped_samples", "ft", 20)
    assert "longest gap 0.075 s" in fault.detail


def test_a_channel_of_another_clock_is_left_out(tmp_path):
    """The sensor stamps from its own start: the simulation went through the years between."""
    rows = run_rows(COUNT)
    for k in range(COUNT):
        rows[3 * k + 2][2].header.stamp.sec -= 1_000_000_000
    got = read_record(write(tmp_path / "a.mcap", McapFile(rows).file()))
    assert "ft" not in got and len(got["position"]) == COUNT and got.epoch_ns == EPOCH
    (fault,) = got.faults
    assert (fault.kind, fault.channel, fault.unit) == ("clock_offset", "ft", "s")
    assert fault.size == pytest.approx(-1e9)
    only = [row for row in rows if row[0] != "/rsea/joint_states"]
    with pytest.raises(BagError, match=r"no measurement is left \(clock offset: left out"):
        read_record(write(tmp_path / "b.mcap", McapFile(only).file()))
