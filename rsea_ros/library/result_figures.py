"""Figures of results as plotly objects that a user can change."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rsea_ros.errors import ParameterError
from rsea_ros.identification.result import Identification, Overlay
from rsea_ros.records.record import UNITS
from rsea_ros.report import words
from rsea_ros.report.figures.figure import AFTER, BEFORE, MEASURED
from rsea_ros.report.figures.response import bode_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plotly.graph_objects import Figure


def fit_figure(result: Identification, response: int) -> Figure:
    """Return the Bode figure of a response, or measured and simulated channels if there is no response.

    Raises ParameterError for a response that the identification does not have, and without plotly.
    """
    if not result.responses:
        return overlay_figure(result.overlays)
    if not 0 <= response < len(result.responses):
        raise ParameterError(f"response = {response}, expected 0 to {len(result.responses) - 1}")
    Figure = _plotly("graph_objects").Figure
    drawn = bode_figure(result.responses[response], result.models[response])
    return Figure(
        data=list(drawn.data), layout={**drawn.layout, "height": drawn.height, "title": drawn.title}
    )


def overlay_figure(before: Sequence[Overlay], after: Sequence[Overlay] = ()) -> Figure:
    """Return each channel as measured and as simulated, one above the other; after: the extended model."""
    figure = _plotly("subplots").make_subplots(rows=len(before), cols=1, shared_xaxes=True)
    for row, overlay in enumerate(before, start=1):
        later = next((o for o in after if o.channel == overlay.channel), None)
        curves = [
            ("measured", MEASURED, overlay.measured),
            ("simulated", BEFORE if later else AFTER, overlay.simulated),
        ]
        curves += [("with the causes", AFTER, later.simulated)] if later else []
        for name, colour, y in curves:
            figure.add_scattergl(
                x=overlay.t,
                y=y,
                name=name,
                line_color=colour,
                legendgroup=name,
                showlegend=row == 1,
                row=row,
                col=1,
            )
        unit = words.unit(UNITS[overlay.channel])
        figure.update_yaxes(title_text=f"{words.channel(overlay.channel)}, {unit}", row=row, col=1)
    figure.update_xaxes(title_text="s", row=len(before), col=1)
    return figure


def _plotly(part: str) -> Any:
    """Return a module of plotly. Raises ParameterError where it is not installed: reports do not need it."""
    try:
        return import_module(f"plotly.{part}")
    except ImportError:
        raise ParameterError("plot() needs the package plotly: pip install plotly") from None
