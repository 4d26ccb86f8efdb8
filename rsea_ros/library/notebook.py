"""Arguments and results of the library: records in; tables, figures and a notebook's bar of progress out."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from rsea_ros.errors import ParameterError, check_kind
from rsea_ros.identification.result import Identification, Overlay, ParameterEstimate
from rsea_ros.progress import Progress
from rsea_ros.records.record import MEASURED, UNITS, Channel, Record, pandas_for
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.response import bode_figure

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class Bar:
    """The present step, and the share of the work that is done, 0 to 1; empty without a step."""

    step: str = ""
    share: float = 0.0

    def __repr__(self) -> str:
        """Return step and share for a notebook that shows plain text."""
        return f"{self.step}: {100.0 * self.share:.0f} %" if self.step else ""

    def _repr_html_(self) -> str:
        bar = f"<progress value='{self.share:.3f}'></progress> {escape(self.step)}"
        return bar if self.step else ""


@contextmanager
def shown_in_notebook(progress: Progress | None) -> Iterator[Progress | None]:
    """Yield the caller's progress if there is one, else in a notebook a bar that vanishes at the end."""
    has_kernel = "ipykernel" in sys.modules and hasattr(import_module("IPython").get_ipython(), "kernel")
    if progress is not None or not has_kernel:  # a terminal of IPython has none
        yield progress
        return
    handle = import_module("IPython.display").display(Bar(), display_id=True)
    try:
        yield lambda step, share: handle.update(Bar(step, share))
    finally:
        handle.update(Bar())


_WIDTH = 140
"""Characters: the width at which `rsea check` prints its table into a file."""


def parameter_frame(parameters: Sequence[ParameterEstimate]) -> Any:
    """Return parameters as a DataFrame: value, unit, low, high (95 %), rig, told_by_data; index: the name.

    Raises ParameterError where pandas is not installed.
    """
    pandas = pandas_for("to_frame")
    rows = {p.name: (p.value, p.unit, *p.ci95, p.start, p.told_by_data) for p in parameters}
    columns = ["value", "unit", "low", "high", "rig", "told_by_data"]
    return pandas.DataFrame.from_dict(rows, orient="index", columns=columns)


def plain(table: Table) -> str:
    """Return a table as text without colours."""
    text = StringIO()
    Console(file=text, width=_WIDTH).print(table)
    return text.getvalue().rstrip()


def records_of(data: Record | Sequence[Record]) -> list[Record]:
    """Return one or several records as a list. Raises ParameterError for anything else."""
    records = list(data) if isinstance(data, Iterable) else [data]
    for record in records:
        check_kind("data", record, Record, "a Record (Record.from_arrays, rsea.read_bag)")
    if len({id(record) for record in records}) < len(records):
        raise ParameterError("data: a record is given twice, expected each record once")
    if not records:
        raise ParameterError("data: no record, expected one or more")
    return records


def without_missing(record: Record) -> Record:
    """Return a record without the samples that from_arrays holds as NaN: measurements that are missing."""
    channels = {name: channel for name, channel in record.channels.items() if name in MEASURED}
    missing = {name: np.isnan(channel.y) for name, channel in channels.items()}
    return record.with_channels(
        **{n: Channel(c.t[~missing[n]], c.y[~missing[n]]) for n, c in channels.items() if missing[n].any()}
    )


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
            ("measured", fig.MEASURED, overlay.measured),
            ("simulated", fig.BEFORE if later else fig.AFTER, overlay.simulated),
        ]
        curves += [("with the causes", fig.AFTER, later.simulated)] if later else []
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
