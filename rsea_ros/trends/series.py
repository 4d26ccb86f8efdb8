"""One parameter of one joint over time, from the recordings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95

Table = Mapping[str, npt.NDArray[Any]]
"""Columns of equal length by name."""
BoolArray = npt.NDArray[np.bool_]

CLOCKS = ("clock.", "clock_rate.")
"""What the names of the sensors' clocks begin with: another in every recording, no property of a joint."""
HISTORY = (
    "joint", "parameter", "unit", "time_s", "value", "low", "high", "identifiable", "temperature",
    "recording", "artefacts",
)  # fmt: skip
RECORDINGS = (
    "joint",
    "recording",
    "time_s",
    "outcome",
    "verdict",
    "residual",
    "faults",
    "causes",
    "artefacts",
)


@dataclass(frozen=True)
class Series:
    """Estimates of a parameter, sorted by time, each array of shape (n,).

    time_s: POSIX s. value, sd: in `unit`; sd from the 95 % interval. identifiable: whether the recording
    determines the parameter. temperature: °C, NaN where unknown. artefacts: path of the recording's results.
    """

    joint: str
    parameter: str
    unit: str
    time_s: FloatArray
    value: FloatArray
    sd: FloatArray
    identifiable: BoolArray
    temperature: FloatArray
    recording: npt.NDArray[Any]
    artefacts: npt.NDArray[Any]

    def keep(self, rows: BoolArray) -> Series:
        """Return the series of some of its rows."""
        arrays = ("time_s", "value", "sd", "identifiable", "temperature", "recording", "artefacts")
        return Series(self.joint, self.parameter, self.unit, **{n: getattr(self, n)[rows] for n in arrays})


def check_columns(table: Table, columns: tuple[str, ...], name: str) -> None:
    """Raise ParameterError where a table lacks a column or has columns of unequal length."""
    missing = [c for c in columns if c not in table]
    if missing:
        raise ParameterError(f"{name}: no column {', '.join(missing)}, expected {', '.join(columns)}")
    lengths = {len(table[c]) for c in columns}
    if len(lengths) > 1:
        raise ParameterError(f"{name}: columns of {sorted(lengths)} rows, expected all of one length")


def all_series(history: Table) -> Iterator[Series]:
    """Yield the series of a history; rows without a time and clocks of sensors are left out.

    Raises ParameterError for a history without its columns.
    """
    check_columns(history, HISTORY, "history")
    joint, parameter = np.asarray(history["joint"], str), np.asarray(history["parameter"], str)
    time_s = np.asarray(history["time_s"], float)
    order = np.lexsort((time_s, parameter, joint))
    order = order[np.isfinite(time_s[order])]
    joint, parameter = joint[order], parameter[order]
    columns = {n: np.asarray(history[n])[order] for n in HISTORY}
    other = (joint[1:] != joint[:-1]) | (parameter[1:] != parameter[:-1])
    edges = [0, *(np.flatnonzero(other) + 1), len(joint)] if len(joint) else []
    for a, b in itertools.pairwise(edges):
        if str(parameter[a]).startswith(CLOCKS):
            continue
        part = {n: c[a:b] for n, c in columns.items()}
        yield _series(str(joint[a]), str(parameter[a]), part)


def _series(joint: str, parameter: str, part: Table) -> Series:
    value = part["value"].astype(float)
    sd = (part["high"].astype(float) - part["low"].astype(float)) / (2.0 * Z95)
    usable = np.isfinite(value) & np.isfinite(sd) & (sd >= 0.0)
    return Series(
        joint,
        parameter,
        str(part["unit"][0]),
        part["time_s"].astype(float),
        value,
        np.where(usable, np.maximum(sd, 1e-9 * np.abs(value)), np.nan),
        part["identifiable"].astype(bool) & usable,
        part["temperature"].astype(float),
        part["recording"],
        part["artefacts"],
    )
