"""The pages of joints that have a cause from their first recording on."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from fleet_histories import cause, history, recordings

from rsea_ros.report.fleet.page import write_fleet_report


@pytest.fixture(scope="module")
def always(tmp_path_factory):
    """The pages of a fleet of which one joint has Coulomb friction from its first day on, growing later."""
    joints = ("hip", "knee", "ankle")
    made = history(
        np.random.default_rng(1), joints=joints, days=40, each=1, sd=1e-6, day_sd=1e-6,
        parameter="rotor.reflected_damping",
    )  # fmt: skip
    size = {d: 0.2 + 0.02 * max(0, d - 20) for d in range(40)}
    names = recordings(
        joints, 40,
        causes=lambda j, d: [cause("coulomb_friction", size[d], "torque", "N m")] if j == "hip" else [],
    )  # fmt: skip
    index = write_fleet_report(made, names, tmp_path_factory.mktemp("always") / "out")
    return {p.name: p.read_text(encoding="utf-8") for p in index.parent.iterdir()}


def test_a_cause_of_the_first_recording_did_not_appear(always):
    """“Coulomb friction appeared about 5 January” stood for one that every recording names."""
    hip = always["joint-hip.html"]
    assert "appeared" not in hip.partition("<h2>All parameters")[0]
    assert "Coulomb friction from the first recording on, growing: now 0.5" in hip
    assert "before 1 Jan 2025" in hip
    assert "cause, 1 from the first recording on" in always["index.html"]
    assert "change, 1 going on" in always["index.html"]


def test_its_growth_is_in_the_title(always):
    assert "<h1>hip: Coulomb friction torque has been rising since 2" in always["joint-hip.html"]


def test_small_shares_and_long_names_read_well(always):
    """`no step above …, 0 %`; `Rotor damping, reflected is steady in all 7 joints that tell it`."""
    knee = always["joint-knee.html"]
    assert "<h2>Rotor damping, reflected, is steady: no step above" in knee
    assert "less than 0.01 %" in knee and ", 0 %" not in knee
    assert "<h2>Rotor damping, reflected: steady in all 3 joints that determine it" in always["index.html"]


def test_a_picture_resolves_what_it_shows(always):
    """Means within 10^-6 of each other were drawn as two heights: five digits were kept."""
    found = re.search(r'id="figure-\d+-data">(.*?)</script>', always["joint-knee.html"])
    weeks = next(trace for trace in json.loads(found[1])["data"] if trace.get("name") == "day")
    assert len(set(weeks["y"])) > 30


def test_a_cause_that_the_data_do_not_distinguish_is_named_with_a_look_alike(tmp_path):
    """With `one_of` in every diagnosis the page named one cause, 99.99 % sure."""
    made = history(np.random.default_rng(1), joints=("hip", "knee", "ankle"), days=30, each=1)

    def causes(joint, d):
        return [cause("backlash", 4e-3, status="one_of", probability=0.7)] if joint == "hip" else []

    worn = recordings(("hip", "knee", "ankle"), 30, causes=causes)
    index = write_fleet_report(made, worn, tmp_path / "out")
    assert "<h1>One joint needs a look, hip first: Backlash or a look-alike, 4.0" in index.read_text()
    hip = (index.parent / "joint-hip.html").read_text(encoding="utf-8")
    assert "<h1>hip: Backlash or a look-alike from the first recording on" in hip
    assert hip.count("Backlash or a look-alike") >= 3
