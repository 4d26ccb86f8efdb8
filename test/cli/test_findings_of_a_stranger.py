"""Commands that misled a new user or failed, each once."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.errors import ParameterError
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def record():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(4).standard_normal(2000), 280.0, seed=4)


def freeze(record):
    y = record["ft"].y.copy()
    y[600:1200] = y[600]
    return record.with_channels(ft=Channel(record["ft"].t, y))


def test_a_bag_given_twice_counts_once(record, tmp_path, refused):
    bag = tmp_path / "bag.mcap"
    write_record(record, bag)
    for verb in ("identify", "diagnose"):
        said = refused(verb, bag, bag, "--out", tmp_path / "out")
        assert f"{bag}: given twice, expected each bag once" in said
    with pytest.raises(ParameterError, match="given twice"):
        rsea.identify([record, record], RIG)


def test_diagnose_tells_of_a_command_that_never_changes(tmp_path, capsys):
    held = rsea.simulate(RIG, np.full(1680, 7.0), 280.0, seed=4)
    write_record(held, tmp_path / "bag.mcap")
    assert main(["diagnose", str(tmp_path / "bag.mcap"), "--out", str(tmp_path / "out")]) == 0
    assert "red: excitation commanded motor torque: 7.00 N·m, the command never changes" in (
        " ".join(capsys.readouterr().out.split())
    )


def clip(record):
    return record.with_channels(ft=Channel(record["ft"].t, np.clip(record["ft"].y, -4.0, 4.0)))


def test_identify_fits_no_sample_that_it_reports(record):
    fit = rsea.identify(clip(freeze(record)), RIG)
    assert {"frozen_samples", "clipping"} <= {fault.kind for fault in fit.result.faults}
    assert fit.result.verdict == "adequate"
    low, high = next(p.ci95 for p in fit.result.parameters if p.name == "spring.stiffness")
    assert low < rsea.load_rig(RIG)["spring.stiffness"] < high
    assert high - low < 2.0


def test_the_verdict_says_that_an_average_biases_the_values(record):
    """Of 20 fits none had the inertia and the stiffness within their intervals, and no line said so."""
    window = np.ones(9) / 9
    moved = ((n, record[n]) for n in ("position", "velocity"))
    averaged = {n: Channel(c.t, np.convolve(c.y, window, "same")) for n, c in moved}
    fit = rsea.identify(record.with_channels(**averaged), RIG)
    missed = [n for n, p in fit.parameters.items() if n[:5] != "clock" and not _holds(p.ci95, n)]
    assert missed
    assert "averaged before logging, which biases values beyond their intervals" in fit.summary()
    assert "biases" not in rsea.identify(record, RIG).summary()


def test_messages_recorded_twice_are_diagnosed_too(record, tmp_path):
    """Every other verb left the second ones out; diagnose asked for rising stamps."""
    twice = {n: Channel(np.repeat(c.t, 2), np.repeat(c.y, 2)) for n, c in record.channels.items()}
    bag = tmp_path / "bag.mcap"
    write_record(record.with_channels(**twice), bag)
    assert main(["diagnose", str(bag), "--out", str(tmp_path / "out")]) == 0
    result = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert result["verdict"] == "nothing_wrong"
    assert {"duplicate_stamps"} == {f["kind"] for f in result["data"]["faults"]}


def test_a_prediction_tells_of_a_turned_sign_and_of_a_zero_that_is_off(record, tmp_path, capsys):
    """A turned command was predicted at -100 % with no fault, an F/T sensor 300 N m off at -8780 %."""
    ft, torque = record["ft"], record["motor_torque"]
    bad = record.with_channels(ft=Channel(ft.t, ft.y + 300.0), motor_torque=Channel(torque.t, -torque.y))
    write_record(bad, tmp_path / "bag.mcap")
    assert main(["predict", RIG, str(tmp_path / "bag.mcap")]) == 0
    faults = json.loads(capsys.readouterr().out)["data"]["faults"]
    assert {("offset", "ft"), ("sign", "motor_torque")} == {(f["kind"], f["channel"]) for f in faults}


def _holds(interval, name):
    return interval[0] < rsea.load_rig(RIG)[name] < interval[1]
