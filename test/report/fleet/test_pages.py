"""The pages of a fleet: their first sentence, their links, and that a browser draws them."""

from __future__ import annotations

import json
import re
import sys
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "trends"))

from fleet_histories import START, cause, history, recordings

from rsea_ros.errors import OutputError
from rsea_ros.report.fleet import write_fleet_report
from rsea_ros.report.fleet.links import page_names
from rsea_ros.report.fleet.words import day, doubt_of_date, name, percent
from rsea_ros.trends import alarms
from test.watch.browser import Browser

JOINTS = ("hip", "knee <left>", "ankle/1", "elbow")
WORN = "knee <left>"
HOW_TO_PAGE = "rsea diagnose BAG --rig RIG --out page"


@pytest.fixture(scope="module")
def tables():
    """A joint that wears, one with backlash from day 50 on, one that cannot be determined."""
    rng = np.random.default_rng(3)
    made = history(
        rng, joints=JOINTS, days=100, course=lambda j, d: -2e-3 * np.clip(d - 40, 0, None) * (j == WORN)
    )
    made["identifiable"] &= made["joint"] != "elbow"
    names = recordings(
        JOINTS, 100, causes=lambda j, d: [cause("backlash", 2e-3)] if j == "hip" and d >= 50 else [],
        faults=lambda j, d: [{"kind": "outliers", "count": 3, "detail": ""}] if d == 7 else [],
    )  # fmt: skip
    return made, names


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


def test_the_first_sentence_names_how_many_and_the_worst(pages):
    assert "<h1>2 of 4 joints need a look, hip first: Backlash, 2.00" in pages["index.html"]
    worn = pages["joint-knee--left-.html"]
    assert "<h1>knee &lt;left&gt;: Spring stiffness has been falling since 1" in worn


def test_a_joint_that_cannot_be_judged_is_listed_with_its_reason(pages):
    assert "One trend not determined" in pages["index.html"]
    assert "Spring stiffness: not enough excitation" in pages["joint-elbow.html"]
    assert "0 of 200 recordings determine it" in pages["joint-elbow.html"]


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
    assert HOW_TO_PAGE not in (index.parent / "joint-hip.html").read_text(encoding="utf-8")


def test_a_recording_without_a_page_says_how_to_make_one(pages):
    assert HOW_TO_PAGE in pages["joint-hip.html"]


def test_links_lead_to_the_joints_and_to_the_diagnosis_that_shows_it(pages, tables):
    for target in re.findall(r'href="(joint-[^"]*)"', pages["index.html"]):
        assert target in pages
    first = next(a for a in alarms(*tables) if a.joint == "hip")
    assert f'href="../store0/{first.artefacts}/diagnosis.json"' in pages["index.html"]


def test_foreign_names_are_escaped(pages):
    assert not any("<left>" in text for text in pages.values())


def test_a_map_has_a_cell_and_a_word_for_each_recorded_week(pages):
    weeks = 15
    cells = re.findall(r"<title>(hip|elbow), ([^:]*): ([^<]*)</title>", pages["index.html"])
    stiffness = [c for c in cells if "recordings" not in c[2]]
    assert len(stiffness) == 2 * weeks
    assert {c[2] for c in stiffness if c[0] == "elbow"} == {"not enough excitation"}


def test_pages_stay_small_and_ask_for_nothing(pages):
    for text in pages.values():
        assert len(text) < 120_000
        assert not re.search(r'(src|href)="(https?:)?//', text)


def test_no_page_is_written_over_what_is_there(tables, tmp_path):
    (tmp_path / "index.html").write_text("mine")
    with pytest.raises(OutputError):
        write_fleet_report(*tables, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["index.html"]


def test_a_browser_draws_a_joint_without_an_error(tables, opened, tmp_path):
    write_fleet_report(*tables, tmp_path / "out")
    document, log = opened((tmp_path / "out" / "joint-hip.html").read_text(encoding="utf-8"), tmp_path)
    assert "CONSOLE" not in log
    assert document.count('data-drawn="yes"') == 2


def test_joints_whose_names_become_alike_have_pages_of_their_own():
    names = page_names(("a b", "a-b", "A b"))
    assert len({n.lower() for n in names.values()}) == 3


@pytest.mark.parametrize(
    ("share", "text"), [(-0.1512, "−15 %"), (0.021, "+2.1 %"), (-0.00034, "−0.03 %"), (1e-9, "0 %")]
)
def test_changes_are_written_as_people_write_them(share, text):
    assert percent(share) == text


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


def test_names_and_dates_are_plain():
    assert day(START) == "1 January 2025"
    assert name("coulomb_friction.torque") == "Coulomb friction torque"
    assert name("command_delay.delay") == "Command delay"
    assert name("spring.stiffness") == "Spring stiffness"


def test_the_doubt_of_a_date_says_month_and_year_once(tables):
    (wear,) = (a for a in alarms(*tables) if a.joint == WORN)
    assert re.fullmatch(r"\d+ (\w{3} )?to \d+ \w{3} 2025", doubt_of_date(wear))


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


def test_a_joint_with_few_days_shows_what_its_latest_recording_says(tmp_path):
    """A table of dashes and grey maps hid values that the store has."""
    made = history(np.random.default_rng(1), joints=("hip",), days=3, told=1.0)
    index = write_fleet_report(made, recordings(("hip",), 3), tmp_path / "out")
    assert "Spring stiffness cannot be determined in any joint" not in index.read_text(encoding="utf-8")
    hip = (tmp_path / "out" / "joint-hip.html").read_text(encoding="utf-8")
    assert re.search(r"\d+ ± [\d.]+ N·m/rad<small>latest recording</small>", hip)
    assert "too few days" in hip and "cannot be determined" not in hip


COLOURS = (
    """[...document.querySelectorAll('.rail i:last-child')].map((i) => getComputedStyle(i).backgroundColor)"""
)
CELLS = """[...document.querySelectorAll('.heat svg [class^=u], .heat svg [class^=d]')]
  .map((c) => getComputedStyle(c).fill)"""
MONTHS = """[...document.querySelectorAll('.months')].map((m) => [...m.children]
  .map((c) => c.getBoundingClientRect()).map((r) => [r.left, r.right]))"""


@pytest.fixture(scope="module")
def fleet_in_browser(tables, tmp_path_factory):
    index = write_fleet_report(*tables, tmp_path_factory.mktemp("shown") / "out")
    with closing(Browser(tmp_path_factory.mktemp("profile"))) as made:
        made.open(index.as_uri())
        made.until("document.querySelector('.heat')")
        yield made


def test_bars_and_cells_have_their_colours_in_a_browser(fleet_in_browser):
    """A script took `--before` in the style for an option of a command: no bar was seen, all cells black."""
    bars, cells = fleet_in_browser.value(COLOURS), fleet_in_browser.value(CELLS)
    assert bars and set(bars) == {"rgb(217, 115, 13)"}
    assert cells and set(cells) <= {"rgb(217, 115, 13)", "rgb(24, 100, 171)"}


@pytest.mark.parametrize("width", [1400, 400, 320])
def test_names_of_months_do_not_overlap(fleet_in_browser, width):
    """On a phone the names of five months lay on each other."""
    fleet_in_browser.size(width, 900)
    rows = fleet_in_browser.value(MONTHS)
    assert rows
    for row in rows:
        assert len(row) > 1 and row[0][0] >= 0.0 and row[-1][1] <= width
        assert all(before[1] <= after[0] for before, after in pairwise(row))


@pytest.fixture(scope="module")
def young(tmp_path_factory):
    """The page of a joint with two parameters and three days."""
    parts = [
        history(np.random.default_rng(1), joints=("hip",), days=3, parameter=parameter)
        for parameter in ("spring.stiffness", "rotor.reflected_damping")
    ]
    made = {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}
    worn = recordings(("hip",), 3, causes=lambda j, d: [cause("backlash", 4e-3)])
    index = write_fleet_report(made, worn, tmp_path_factory.mktemp("young") / "out")
    return index.parent / "joint-hip.html"


def test_parameters_without_a_trend_for_one_reason_share_a_section(young):
    """Four sections stood one below the other with the same sentence."""
    text = young.read_text(encoding="utf-8")
    assert "<h2>2 parameters: too few days</h2>" in text
    assert text.count("8 days are needed") == 1
    assert "Rotor damping, reflected; Spring stiffness. 6 of 6 recordings" in text


def test_the_axis_of_a_few_days_names_days(young, fleet_in_browser):
    """It named noons, and days as Americans write them."""
    fleet_in_browser.open(young.as_uri())
    fleet_in_browser.until("document.querySelector('.xtick text')")
    ticks = fleet_in_browser.value("[...document.querySelectorAll('.xtick text')].map((t) => t.textContent)")
    assert ticks[:3] == ["1 Jan2025", "2 Jan", "3 Jan"]
