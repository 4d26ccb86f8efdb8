"""Figures of the paper: their values, and drawings that are valid SVG."""

from __future__ import annotations

import functools
import json
from dataclasses import asdict
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rsea_ros.report.page import table
from rsea_ros.report.paper.circuit_drawing import epicyclic_circuit, general_circuit, lumped_circuit
from rsea_ros.report.paper.docs import documentation_figures
from rsea_ros.report.paper.figures import figure_9, figure_18_as_printed, figure_20

FIGURES = Path(__file__).parents[3] / "docs" / "figures"
drawn = functools.cache(documentation_figures)


@pytest.mark.parametrize(
    ("drawing", "names"),
    [
        (general_circuit, ("Z", "lp", "ld", "T")),
        (lumped_circuit, ("eff", "sc", "clamped: open")),
        (epicyclic_circuit, ("Mu", "1", "2", "J")),
    ],
)
def test_circuits_are_drawn_with_their_names(drawing, names):
    svg = ElementTree.fromstring(drawing())
    words = {text for node in svg.iter() for text in (node.text or "", node.tail or "")}
    assert all(any(name in word for word in words) for name in names)
    assert len(svg.findall(".//{http://www.w3.org/2000/svg}path")) > 8


def test_the_surface_is_eq_7():
    surface = figure_9()[0].data[0]
    k, j = np.array(surface["x"]), 1e-3 * np.array(surface["y"])
    expected = np.sqrt(0.292 * k[None, :] / j[:, None]) / (2 * np.pi)
    np.testing.assert_allclose(np.array(surface["z"]), expected, rtol=1e-4)


def test_titles_contain_the_numbers():
    assert "55.8 Hz by Eq. (7), 55.5 Hz printed (+0.6 %); 19.9 or 15.3 Hz" in figure_20().title
    assert "19.8 Hz unlumped, at 6.1 Hz lumped" in figure_18_as_printed().title
    assert "62.0 dB" in figure_18_as_printed().caption


def test_figures_are_json():
    for figure in (*figure_9(), figure_20(), figure_18_as_printed()):
        json.dumps(asdict(figure), allow_nan=False)


def test_a_table_is_escaped_and_aligned():
    html = table(["a", "#b"], [["<i>", "1"]])
    assert "&lt;i&gt;" in html
    assert "<td class='number'>1</td>" in html


def test_every_figure_of_the_derivation_is_one_that_the_program_draws():
    assert {path.name for path in FIGURES.iterdir()} == set(drawn())


@pytest.mark.parametrize("name", sorted(path.name for path in FIGURES.iterdir()))
def test_figures_of_the_derivation_are_what_the_program_draws(name):
    path, made = FIGURES / name, drawn()[name]
    assert path.read_text(encoding="utf-8") == made, f"rsea paper --figures docs/figures --force makes {name}"
    assert f"figures/{name}" in (path.parents[1] / "derivation.md").read_text(encoding="utf-8")
