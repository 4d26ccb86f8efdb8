"""One parameter of one joint over time, from the recordings, and the numbers that steer its trend."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95

DAY = 86400.0
"""s."""
YEAR = 365.25
"""Days."""


@dataclass(frozen=True)
class TrendSettings:
    """Limits for a determined series, a change and an alarm.

    false_discovery: share of the findings of one look that may be false, over all joints and parameters
        (Benjamini and Hochberg 1995). 0.01: the weekly looks of a year then bring less than one in two.
    fewest_days: days with an estimate below which a series is undetermined. 8: a scatter of days is known to
    a
        quarter then.
    fewest_beside: days on either side of a change. 3: a day and a repeated day are no change.
    block_days: days with data whose scatter about their mean is noise. 12: a fortnight and more, slower than
        the effect of a day, faster than wear.
    date_doubt: fall of twice the log likelihood within which a date may lie, 95 % (chi-squared, 1).
    widest: least detectable step, as a share of the level, above which a series is undetermined.
    outlier_days: scaled distance of a recording from its neighbours' median above which it is left out. 6:
        one in 10^9 of normal ones.
    outlier_joint: robust score above which a joint is unlike its fleet. 4.5: one in 10^5.
    fewest_joints: joints of a parameter below which nobody is an outlier.
    background: share of the days on which a cause or a fault may be named in error.
    fewest_named: days that must name a cause or a fault before it counts as appeared.
    limit: relative change from the first level up to which a joint is good, where no other limit is given.
    limits: low and high limit by parameter, in its unit.
    """

    false_discovery: float = 0.01
    fewest_days: int = 8
    fewest_beside: int = 3
    block_days: int = 12
    date_doubt: float = 3.84
    widest: float = 0.5
    outlier_days: float = 6.0
    outlier_joint: float = 4.5
    fewest_joints: int = 5
    background: float = 0.03
    fewest_named: int = 3
    limit: float = 0.25
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


DEFAULT = TrendSettings()


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
