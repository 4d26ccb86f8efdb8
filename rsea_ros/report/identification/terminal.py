"""The result on a terminal."""

from __future__ import annotations

from collections.abc import Mapping

from rich.table import Table

from rsea_ros.identification.result import CLOCKS, Identification, ParameterEstimate
from rsea_ros.report import words
from rsea_ros.report.identification.parameters import value_text


def terminal_table(identification: Identification, truth: Mapping[str, float] | None = None) -> Table:
    """Return the parameters with their 95 % intervals. truth: true values by name, where they are known."""
    table = Table(box=None, pad_edge=False, title_justify="left", header_style="dim")
    table.add_column("parameter")
    table.add_column("value ± 95 %", justify="right")
    table.add_column("unit", style="dim")
    table.add_column("rig", justify="right")
    if truth is not None:
        table.add_column("true", justify="right")
        table.add_column("in interval")
    table.add_column("determined by data")
    for p in identification.parameters:
        if not p.name.startswith(CLOCKS):
            table.add_row(*_cells(p, truth))
    return table


def _cells(p: ParameterEstimate, truth: Mapping[str, float] | None) -> list[str]:
    cells = [p.name, "".join(value_text(p)), words.unit(p.unit), words.number(p.start, 4)]
    if truth is not None:
        cells += _against(p, truth)
    return [*cells, p.determined]


def _against(p: ParameterEstimate, truth: Mapping[str, float]) -> list[str]:
    if p.name not in truth:
        return ["", ""]
    true = truth[p.name]
    inside = p.ci95[0] <= true <= p.ci95[1]
    return [words.number(true, 5), "[green]yes[/]" if inside else "[red]no[/]"]
