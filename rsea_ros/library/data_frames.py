"""Results as tables: a pandas DataFrame where pandas is installed, and plain text."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from io import StringIO
from typing import Any

from rich.console import Console
from rich.table import Table

from rsea_ros.errors import ParameterError
from rsea_ros.identification.result import ParameterEstimate

_WIDTH = 140
"""Characters: the width at which `rsea check` prints its table into a file."""


def parameter_frame(parameters: Sequence[ParameterEstimate]) -> Any:
    """Return parameters as a DataFrame: value, unit, low, high (95 %), rig, told_by_data; index: the name.

    Raises ParameterError where pandas is not installed.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError:
        raise ParameterError("to_frame: pandas is not installed, expected it (pip install pandas)") from None
    rows = {p.name: (p.value, p.unit, *p.ci95, p.start, p.told_by_data) for p in parameters}
    columns = ["value", "unit", "low", "high", "rig", "told_by_data"]
    return pandas.DataFrame.from_dict(rows, orient="index", columns=columns)


def plain(table: Table) -> str:
    """Return a table as text without colours."""
    text = StringIO()
    Console(file=text, width=_WIDTH).print(table)
    return text.getvalue().rstrip()
