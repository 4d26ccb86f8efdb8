"""Findings on the sensors themselves, and the table of codes in the docs."""

import re
from pathlib import Path

import numpy as np
import pytest

from rsea_ros.health.health_finding import NAMES, TABLE, Sensors, sensor_findings
from rsea_ros.health.hypotheses import hypotheses_of
from rsea_ros.health.monitor import Monitor
from rsea_ros.model.observer import noise_of
from rsea_ros.model.observer.log import events_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RATE = 280.0
RIG = load_rig("paper_high_impedance")
T = np.arange(round(3.0 * RATE)) / RATE
RECORD = synthesize(RIG, Channel(T, 8.0 * np.sin(9.0 * T)), seed=1)


def codes_of(**channels):
    """Codes and names that a record with other channels gives, taken in pieces."""
    sensors, record = Sensors(RIG), RECORD.with_channels(**channels)
    t, kind, values = events_of(record)
    for k in range(0, len(t), 200):
        sensors.take(t[k : k + 200], kind[k : k + 200], values[k : k + 200])
    return [(f.code, f.name) for f in sensor_findings(sensors, 0, 0)]


def with_values(name, change):
    y = RECORD[name].y.copy()
    return Channel(RECORD[name].t, change(y))


def freeze(y):
    y[400:] = y[400]
    return y


def test_a_good_record_and_rest_have_no_findings():
    still = synthesize(RIG, Channel(T, np.zeros(len(T))), seed=1)
    assert codes_of() == [] and codes_of(**still.channels) == []


@pytest.mark.parametrize("name", ["position", "ft", "motor_torque"])
def test_a_sensor_that_stops_is_frozen(name):
    assert codes_of(**{name: with_values(name, freeze)}) == [("RSEA_SENSOR_FROZEN", name)]


def test_after_a_clock_was_set_the_watch_restarts_and_reports_it():
    monitor = Monitor(RIG, noise_of(RIG))
    t, kind, values = events_of(RECORD)
    monitor.take(t, kind, values)
    monitor.take(t - 3600.0, kind, values)
    assert monitor.jumps == 1 and monitor.late == 0 and monitor.looks >= 3
    assert [f.code for f in monitor.findings()] == ["RSEA_BAD_DATA"]


PAGE = Path(__file__).resolve().parents[2] / "docs" / "health.md"


def test_the_docs_have_the_table():
    page = PAGE.read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(RSEA_\w+)` \| (.*?) \| (.*?) ?\|$", page, re.MULTILINE)
    assert rows == [tuple(code) for code in TABLE]


def test_every_hypothesis_has_a_code_of_the_table():
    assert {h.code for h in hypotheses_of(load_rig("paper_high_impedance"), 1.0 / 280.0)} <= set(NAMES)
