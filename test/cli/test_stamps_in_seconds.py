"""Stamps in another unit than seconds: one line from every verb, for rigs with and without a spring."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.records.record import Channel

ASKED = "are the stamps in s"


@functools.cache
def run_of(rig, unit, rate=280.0):
    size, n = 0.3 if rig == "pd_joint" else 10.0, min(int(5 * rate), 10_000)
    record = rsea.simulate(rig, size * np.random.default_rng(4).standard_normal(n), rate, seed=4)
    return record.with_channels(**{n: Channel(unit * c.t, c.y) for n, c in record.channels.items()})


@pytest.mark.parametrize(
    ("rig", "unit"), [("paper_high_impedance", 1e3), ("emps", 1e6), ("pd_joint", 1e-3)]
)
def test_every_verb_asks_for_the_unit_in_one_line(rig, unit, tmp_path, refused, capsys):
    """Of a rigid drive µs asked for 149 GiB, ms were "a bug in rsea"; ks gave a prediction of nothing."""
    bag, out = str(tmp_path / "bag.mcap"), str(tmp_path / "out")
    write_record(run_of(rig, unit), bag)
    verbs = (["predict", rig, bag], *([v, bag, "--rig", rig, "--out", out] for v in ("identify", "diagnose")))
    for arguments in verbs:
        assert ASKED in refused(*arguments)
    assert main(["check", bag, "--rig", rig, "--json", "--fail-on", "red"]) == 1
    (record,) = json.loads(capsys.readouterr().out)["records"]
    assert ASKED in " ".join(f["remedy"] for f in record["findings"] if f["light"] == "red")
    assert not [f for f in record["findings"] if f["kind"] in ("clock_jump", "wrong_rig")]


def test_a_fast_logger_and_a_slow_one_are_not_asked():
    for rate in (5.0, 20000.0):
        said = " ".join(rsea.check(run_of("emps", 1.0, rate), "emps").summary().split())
        assert ASKED not in said
