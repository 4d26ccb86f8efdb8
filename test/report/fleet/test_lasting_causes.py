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


def test_a_picture_resolves_what_it_shows(always):
    """Means within 10^-6 of each other were drawn as two heights: five digits were kept."""
    found = re.search(r'id="figure-\d+-data">(.*?)</script>', always["joint-knee.html"])
    weeks = next(trace for trace in json.loads(found[1])["data"] if trace.get("name") == "day")
    assert len(set(weeks["y"])) > 30
