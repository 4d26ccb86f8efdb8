"""plotly.js for a page: the bundle of plane figures where it can draw them all, else the whole one.

The bundle of plane figures is the npm package plotly.js-cartesian-dist-min, unchanged but packed; its
MIT licence lies beside it. Its version is that of the plotly package, whose bundle draws the rest: surfaces.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from rsea_ros.errors import RseaError
from rsea_ros.report.figures.figure import Figure

VENDOR = Path(__file__).parent / "vendor"
VERSION = "4.1.1"
SHA256 = "79542150855a52c567260e3137095dbe2b744e6d702a5cabe67da246942fba7a"
"""Of plotly-cartesian.min.js as npm has it."""
PLANE = {
    "bar", "box", "contour", "heatmap", "histogram", "histogram2d", "histogram2dcontour", "image", "pie",
    "scatter", "scatterternary", "violin",
}  # fmt: skip
"""Types of traces that it draws, as its README lists them."""
_LEVEL = 5
"""Of gzip: 9 takes twice the time of each report for one percent of its size."""


def plotly_for(figures: Iterable[Figure]) -> str:
    """Return plotly.js for some figures, as base64 of gzip; page.js unpacks it in the browser.

    Raises RseaError where a figure needs the whole bundle and the plotly package is missing.
    """
    kinds = {str(trace.get("type", "scatter")) for figure in figures for trace in figure.data}
    return _plane() if kinds <= PLANE else _whole()


@lru_cache(maxsize=1)
def _plane() -> str:
    packed = (VENDOR / "plotly-cartesian.min.js.gz").read_bytes()
    return base64.b64encode(packed).decode("ascii")


@lru_cache(maxsize=1)
def _whole() -> str:
    spec = find_spec("plotly")
    if spec is None or not spec.submodule_search_locations:
        raise RseaError("report: package plotly is missing, expected it installed for its plotly.min.js")
    script = Path(spec.submodule_search_locations[0]) / "package_data" / "plotly.min.js"
    return base64.b64encode(gzip.compress(script.read_bytes(), _LEVEL, mtime=0)).decode("ascii")
