"""Pages on a phone, and while the colours of the system change, in a real browser."""

import json

import numpy as np
import pytest

from rsea_ros.report.diagnosis.figures import sketch
from rsea_ros.report.figures.figure import BEFORE, INK, Figure, axis, label, layout, line
from rsea_ros.report.page import Html, equation, page, table

CAUSE = ["ft_gain_error"]
CURVE = Figure("Rising", "", [{"type": "scatter", "x": [0, 1], "y": [0, 1], "name": "y"}], layout())
LAW = "T = -saturating_drag · tanh(ω/drag_width) - stribeck · exp(-(ω/stribeck_velocity)²)·sign(ω)"
UNITS = {"xaxis": axis("time, s"), "yaxis": axis("torque, N·m")}
BESIDE = [label(name, 1.01, y, INK, xref="paper", yref="paper") for name, y in (("y", 0.9), ("z", 0.5))]
_X = np.linspace(0.0, 1.0, 9)
TWO = Figure(
    "Two", "",
    [line(_X, _X, "y", INK, hoverinfo="skip"),
     line(_X, -_X, "z", BEFORE, line={"color": BEFORE, "dash": "dot"}, hoverinfo="skip")],
    layout(annotations=BESIDE, margin={"l": 64, "r": 190, "t": 12, "b": 48}, **UNITS),
)  # fmt: skip
PLOTTED = """[...document.querySelectorAll('.figure')].map((f) => f._fullLayout._size.w / f.clientWidth)"""
SHOWN = """[...document.querySelectorAll('.sketch .culprit .cause')].map((e) => e.getBoundingClientRect())
  .filter((r) => r.width > 0).map((r) => [r.left, r.right, r.height])"""
COLOUR = "document.querySelector('.figure').layout.font.color"
LIGHT, DARK = ([{"name": "prefers-color-scheme", "value": value}] for value in ("light", "dark"))


@pytest.fixture(scope="module")
def two_curves(shown):
    rows = table(["trial", "asked", "measured"], [["crossover", "", "13.7 Hz"]])
    return shown(page("t", "k", [Html(sketch(CAUSE) + equation(LAW)), TWO, CURVE, rows], []))


@pytest.mark.parametrize("width", [1400, 400, 320])
def test_the_name_of_the_culprit_is_in_view_and_can_be_read(two_curves, width):
    """At 400 px the drawing ended behind the encoder, and the F/T sensor was out of view."""
    two_curves.size(width, 900)
    ((left, right, height),) = two_curves.value(SHOWN)
    assert 0.0 <= left < right <= width and height > 10.0


def test_figures_follow_the_colours_of_the_system(two_curves):
    """Curves drawn in the dark kept their grid on a page that had become white."""
    for look, expected in ((DARK, "#e4e7eb"), (LIGHT, INK)):
        two_curves.call("Emulation.setEmulatedMedia", features=look)
        two_curves.until(f"({COLOUR}) === {json.dumps(expected)}", seconds=5.0)
    two_curves.until("document.querySelectorAll('.tools').length === 2")
    assert two_curves.errors == []


def test_a_figure_has_the_width_of_a_phone(two_curves):
    """Names beside the curves left them a quarter of the screen."""
    two_curves.size(1400, 900)
    two_curves.until("document.querySelectorAll('.figure')[0].layout.annotations.length === 2")
    two_curves.size(400, 900)
    two_curves.until("document.querySelectorAll('.figure')[0].layout.annotations.length === 0")
    two_curves.until(f"Math.min(...{PLOTTED}) > 0.7")
    assert two_curves.errors == []


def test_a_figure_drawn_anew_before_it_is_done_has_one_row_of_switches(two_curves):
    """The colours or the width changed while long curves were being unpacked: each drawing made a row."""
    two_curves.value("draw(); draw()")
    two_curves.until("document.querySelectorAll('[data-drawn]').length === 2")
    two_curves.value("new Promise((done) => setTimeout(done, 300))")
    assert two_curves.value("document.querySelectorAll('.tools').length") == 2


PRESS = "[...document.querySelectorAll('.tools button')].find((b) => b.textContent === '%s').click()"
SEEN = """Plotly.downloadImage = (figure) => {
  window.names = figure.layout.annotations.map((a) => a.text);
  window.paper = figure.layout.paper_bgcolor; }"""


@pytest.mark.parametrize("width", [1400, 400])
def test_the_columns_of_the_numbers_have_units(two_curves, width):
    two_curves.size(width, 900)
    two_curves.until("document.querySelectorAll('.tools').length === 2")
    two_curves.value("save = (name, text) => { window.saved = text; }")
    two_curves.value(PRESS % "CSV")
    head, first, *_ = two_curves.value("window.saved").splitlines()
    assert head == '"y: time, s","y: torque, N·m","z: time, s","z: torque, N·m"' and first == "0,0,0,0"


@pytest.mark.parametrize("width", [1400, 400])
def test_the_picture_names_its_curves(two_curves, width):
    """On a phone only the switches below named them, and a picture has no switches."""
    two_curves.size(width, 900)
    beside = 2 if width > 640 else 0
    two_curves.until(f"document.querySelectorAll('.figure')[0].layout.annotations.length === {beside}")
    two_curves.until("document.querySelectorAll('.tools').length === 2")
    two_curves.value(SEEN)
    two_curves.value(PRESS % "PNG")
    assert two_curves.value("window.names") == ["y", "z"]
    assert two_curves.value("window.paper") == "rgb(255, 255, 255)", "readable on any ground"


LONG = "The fit holds only if what the model lacks does not move its values."
OPTION = """(() => { let n = document.querySelector('code'); while (n.lastChild) n = n.lastChild;
  const r = document.createRange(); r.setStart(n, n.length - 5); r.setEnd(n, n.length);
  return [r.toString(), new Set([...r.getClientRects()].map((box) => box.top)).size]; })()"""
BOXES = """[...document.querySelectorAll('tbody td')].slice(1).map((cell) => {
  const of = (node) => { const r = document.createRange(); r.selectNodeContents(node);
    const box = r.getBoundingClientRect(); return [box.left, box.right, box.top]; };
  return [of(cell), cell.querySelector('small') ? of(cell.querySelector('small')) : null]; })"""


@pytest.fixture(scope="module")
def cards(shown):
    """A table on a phone: a short value with a note, and a sentence."""
    value = Html("1500 <sub>r</sub><small>noted</small>")
    rows = table(["name", "value", "about"], [["K_s", value, LONG]])
    code = Html("<code style='display: block; width: 10ch'>1234567 --rig</code>")
    made = shown(page("t", "k", [rows, code], []), width=400)
    made.until("document.querySelector('[data-label]')")
    return made


def test_an_option_is_not_broken_behind_its_hyphens(cards):
    assert cards.value(OPTION) == ["--rig", 1]


def test_a_sentence_of_a_card_begins_at_its_left(cards):
    _, (sentence, _) = cards.value(BOXES)
    assert sentence[0] < 20.0


def test_a_note_of_a_card_stands_below_its_value(cards):
    """Both were columns, the note in the middle of the card."""
    (whole, note), _ = cards.value(BOXES)
    assert note[1] == pytest.approx(whole[1], abs=1.0) and note[2] > whole[2] + 10.0
