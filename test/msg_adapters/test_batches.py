"""Long records are written part by part: the messages are those of one piece, in the same order."""

from __future__ import annotations

import numpy as np

from msg_adapters import iterate, write_record
from rsea_ros.records.record import Channel, Record


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
