"""The pages of joints with too few recordings for a trend, or with none that has a date."""

from __future__ import annotations

import re

import numpy as np
from fleet_histories import START, cause, history, recordings
from worn_fleet import JOINTS

from rsea_ros.report.fleet.page import write_fleet_report


def test_a_cause_in_the_latest_recording_is_reported_before_a_trend_exists(tmp_path):
    """Of two recordings of two joints, one worn, the worn joint was listed as steady."""
    joints = ("left", "right")
    made = history(np.random.default_rng(1), joints=joints, days=2)
    worn = recordings(joints, 2, causes=lambda j, d: [cause("backlash", 4e-3)] if j == "right" and d else [])
    index = write_fleet_report(made, worn, tmp_path / "out")
    text = index.read_text(encoding="utf-8")
    assert "<h1>Too few recordings yet for trends; the latest name backlash in right" in text
    assert "now backlash" in text and "<td>steady</td>" not in text
    assert "<h1>right: backlash in its latest recording" in (index.parent / "joint-right.html").read_text()


def test_a_cause_that_every_one_of_a_few_recordings_names_has_its_figure(tmp_path):
    """A cause named once had one, and that of the title none: with so few days its size has no trend."""
    made = history(np.random.default_rng(1), joints=("hip",), days=2)
    worn = recordings(("hip",), 2, causes=lambda j, d: [cause("backlash", 4e-3)])
    index = write_fleet_report(made, worn, tmp_path / "out")
    hip = (index.parent / "joint-hip.html").read_text(encoding="utf-8")
    assert "<h1>hip: backlash in its latest recording" in hip
    assert "<h2>Backlash is named in 2 of 2 recordings</h2>" in hip


def test_the_headline_of_many_joints_with_causes_counts_them(tmp_path):
    """Three joints of two causes each filled six lines of the page."""
    made = history(np.random.default_rng(1), joints=JOINTS, days=2)
    worn = recordings(JOINTS, 2, causes=lambda j, d: [cause("backlash", 4e-3)] if j != "hip" else [])
    text = write_fleet_report(made, worn, tmp_path / "out").read_text(encoding="utf-8")
    assert "<h1>Too few recordings yet for trends; the latest of 3 joints name causes</h1>" in text


def test_a_joint_of_a_few_days_says_so_and_not_that_it_cannot_be_determined(tmp_path):
    made = history(np.random.default_rng(1), joints=JOINTS, days=100)
    kept = (made["joint"] != "hip") | (made["time_s"] < START + 3 * 86_400.0)
    few = {name: column[kept] for name, column in made.items()}
    index = write_fleet_report(few, recordings(JOINTS, 100), tmp_path / "out")
    cells = re.findall(r"<title>hip, [^<:]*: ([^<]*)</title>", index.read_text(encoding="utf-8"))
    assert cells and {text for text in cells if "recordings" not in text} == {"too few days"}
    assert "rsea diagnose BAG" not in (index.parent / "joint-hip.html").read_text(encoding="utf-8")


def test_a_joint_with_few_days_shows_what_its_latest_recording_says(tmp_path):
    """A table of dashes and grey maps hid values that the store has."""
    made = history(np.random.default_rng(1), joints=("hip",), days=3, told=1.0)
    index = write_fleet_report(made, recordings(("hip",), 3), tmp_path / "out")
    assert "Spring stiffness cannot be determined in any joint" not in index.read_text(encoding="utf-8")
    hip = (tmp_path / "out" / "joint-hip.html").read_text(encoding="utf-8")
    assert re.search(r"\d+ ± [\d.]+ N·m/rad<small>latest recording</small>", hip)
    assert "too few days" in hip and "cannot be determined" not in hip


def test_parameters_without_a_trend_for_one_reason_share_a_section(young):
    """Four sections stood one below the other with the same sentence."""
    text = young.read_text(encoding="utf-8")
    assert "<h2>2 parameters: too few days</h2>" in text
    assert text.count("8 days are needed") == 1
    assert "Rotor damping, reflected; Spring stiffness. 6 of 6 recordings" in text


def test_a_joint_without_a_date_has_its_row_and_its_page(tmp_path):
    """Of six public machines the two without a date were missing on the page, and nothing said so."""
    names = recordings(("hip", "rail"), 3, causes=lambda j, d: [cause("backlash", 2e-3)])
    names["time_s"] = np.where(names["joint"] == "rail", np.nan, names["time_s"])
    made = history(np.random.default_rng(1), joints=("hip", "rail"), days=3)
    made["time_s"] = np.where(made["joint"] == "rail", np.nan, made["time_s"])
    index = write_fleet_report(made, names, tmp_path / "out").read_text(encoding="utf-8")
    assert "Fleet of 2 joints" in index and "no recording has a date" in index
    rail = (tmp_path / "out" / "joint-rail.html").read_text(encoding="utf-8")
    assert "<h1>rail: no recording has a date" in rail
    assert "No recording has a date" in rail and "“date” in joints.yaml" in rail
    assert "latest recording" not in rail, "without dates none is the latest"
    assert "0 of 0" not in rail and re.search(r"<small>spring.stiffness</small>.*?1\d{3} N·m/rad", rail)
