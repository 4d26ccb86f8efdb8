"""The pages of a fleet: sentences, links, dates and lasting causes."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from fleet_histories import cause, history, recordings

from rsea_extras.pages.page import write_fleet_report
from rsea_extras.pages.words import page_names
from rsea_extras.trends import alarms


@pytest.fixture(scope="module")
def pages(tables, tmp_path_factory):
    """The pages by file name, without the bundle that draws figures."""
    store = tmp_path_factory.mktemp("store")
    shown = store / next(a for a in alarms(*tables) if a.joint == "hip").artefacts
    shown.mkdir(parents=True)
    (shown / "diagnosis.json").write_text("{}")
    index = write_fleet_report(*tables, store.parent / "out", store=store)
    texts = {p.name: p.read_text(encoding="utf-8") for p in index.parent.iterdir()}
    return {n: re.sub(r'<script type="text/plain" id="plotly">.*?</script>', "", t) for n, t in texts.items()}


def test_links_lead_to_the_joints_and_to_the_diagnosis_that_shows_it(pages, tables):
    for target in re.findall(r'href="(joint-[^"]*)"', pages["index.html"]):
        assert target in pages
    first = next(a for a in alarms(*tables) if a.joint == "hip")
    assert f'href="../store0/{first.artefacts}/diagnosis.json"' in pages["index.html"]


def test_foreign_names_are_escaped(pages):
    assert not any("<left>" in text for text in pages.values())


def test_joints_whose_names_become_alike_have_pages_of_their_own():
    names = page_names(("a b", "a-b", "A b"))
    assert len({n.lower() for n in names.values()}) == 3


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


def test_a_picture_resolves_what_it_shows(always):
    """Means within 10^-6 of each other were drawn as two heights: five digits were kept."""
    found = re.search(r'id="figure-\d+-data">(.*?)</script>', always["joint-knee.html"])
    weeks = next(trace for trace in json.loads(found[1])["data"] if trace.get("name") == "day")
    assert len(set(weeks["y"])) > 30
