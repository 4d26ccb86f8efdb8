"""Figures of the paper: their values, and the drawings of docs/derivation.md."""

import functools
from pathlib import Path

import numpy as np
import pytest

from rsea_ros.paper.figures import documentation_figures, figure_9

FIGURES = Path(__file__).parents[2] / "docs" / "figures"
drawn = functools.cache(documentation_figures)


def test_the_surface_is_eq_7():
    surface = figure_9()[0].data[0]
    k, j = np.array(surface["x"]), 1e-3 * np.array(surface["y"])
    expected = np.sqrt(0.292 * k[None, :] / j[:, None]) / (2 * np.pi)
    np.testing.assert_allclose(np.array(surface["z"]), expected, rtol=1e-4)


def test_every_figure_of_the_derivation_is_one_that_the_program_draws():
    assert {path.name for path in FIGURES.iterdir()} == set(drawn())


@pytest.mark.parametrize("name", sorted(path.name for path in FIGURES.iterdir()))
def test_figures_of_the_derivation_are_what_the_program_draws(name):
    path, made = FIGURES / name, drawn()[name]
    assert path.read_text(encoding="utf-8") == made, f"rsea paper --figures docs/figures --force makes {name}"
    assert f"figures/{name}" in (path.parents[1] / "derivation.md").read_text(encoding="utf-8")
