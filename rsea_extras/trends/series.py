"""Parameters, causes and faults of a joint over time, from its recordings; the numbers that steer a trend."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rsea_ros.extension.base import Z95, FloatArray, ParameterError

DAY = 86400.0
"""s."""
YEAR = 365.25
"""Days."""


@dataclass(frozen=True)
class TrendSettings:
    """Limits for a determined series, a change and an alarm.

    false_discovery: share of the findings of one look that may be false, over all joints and parameters
        (Benjamini and Hochberg 1995). 0.01: the weekly looks of a year then bring less than one in two.
    fewest_days: days with an estimate below which a series is undetermined. 8: a scatter of days is known
        to a quarter then.
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
    "joint", "recording", "time_s", "outcome", "verdict", "residual", "faults", "causes", "artefacts"
)  # fmt: skip


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
        if not str(parameter[a]).startswith(CLOCKS):
            yield _series(str(joint[a]), str(parameter[a]), {n: c[a:b] for n, c in columns.items()})


def _series(joint: str, parameter: str, part: Table) -> Series:
    value = part["value"].astype(float)
    sd = (part["high"].astype(float) - part["low"].astype(float)) / (2.0 * Z95)
    usable = np.isfinite(value) & np.isfinite(sd) & (sd >= 0.0)
    sd = np.where(usable, np.maximum(sd, 1e-9 * np.abs(value)), np.nan)
    time_s, temperature = (part[n].astype(float) for n in ("time_s", "temperature"))
    return Series(
        joint, parameter, str(part["unit"][0]), time_s, value, sd, part["identifiable"].astype(bool) & usable,
        temperature, part["recording"], part["artefacts"],
    )  # fmt: skip


NULLS: Mapping[str, float] = {"gain": 1.0}
"""Value at which a cause vanishes, by its parameter's name; 0 for the others."""
ENDLESS = frozenset({"stiffness", "limit", "angle", "frequency"})
"""Parameters that grow without an end where the cause vanishes: no zero stands for its absence."""
_LIKELY = 0.5
"""Probability from which a name counts that has rivals."""
_BEST = 0.1
"""Quantile of the recordings, by how small a size they show."""
_LEAST_GAIN = 0.05
"""Gain below which a diagnosis names no cause (diagnosis/settings.py, acceptance.fall)."""


@dataclass(frozen=True)
class Naming:
    """A cause or fault in a joint's recordings, sorted by time, each array of shape (n,).

    row: places in the table of recordings. named: which name it. limit: size below which it would not have
    been named, NaN where unknown. parameter, unit, size: of the cause's main parameter; empty for a fault.
    """

    joint: str
    about: str
    kind: Literal["cause", "fault"]
    row: np.ndarray
    time_s: FloatArray
    named: BoolArray
    parameter: str = ""
    unit: str = ""
    size: FloatArray | None = None
    sd: FloatArray | None = None
    status: str = ""
    limit: float = float("nan")


def namings(recordings: Table) -> Iterator[Naming]:
    """Yield for each joint every cause and fault that its recordings name at least once.

    Raises ParameterError for a table without its columns.
    """
    check_columns(recordings, RECORDINGS, "recordings")
    joint = np.asarray(recordings["joint"], str)
    time_s = np.asarray(recordings["time_s"], float)
    done = np.asarray(recordings["outcome"], str) == "done"
    for name in np.unique(joint):
        rows = np.flatnonzero((joint == name) & np.isfinite(time_s))
        rows = rows[np.argsort(time_s[rows], kind="stable")]
        yield from _faults(str(name), rows, time_s, recordings["faults"])
        yield from _causes(str(name), rows[done[rows]], time_s, recordings["causes"])


def _faults(joint: str, rows: np.ndarray, time_s: FloatArray, faults: npt.NDArray[Any]) -> Iterator[Naming]:
    kinds = [{str(f["kind"]) for f in faults[i]} for i in rows]
    for kind in sorted(set().union(*kinds)):
        yield Naming(joint, kind, "fault", rows, time_s[rows], np.array([kind in k for k in kinds]))


def _causes(joint: str, rows: np.ndarray, time_s: FloatArray, causes: npt.NDArray[Any]) -> Iterator[Naming]:
    of_row = [
        {c["name"]: c for c in causes[i] if c["status"] != "one_of" or float(c["probability"]) >= _LIKELY}
        for i in rows
    ]
    for name in sorted(set().union(*of_row)):
        of_recording = [row.get(name) for row in of_row]
        yield _cause(joint, str(name), rows, time_s[rows], of_recording)


def _cause(
    joint: str, name: str, rows: np.ndarray, time_s: FloatArray, found: Sequence[Mapping[str, Any] | None]
) -> Naming:
    main = next((c["sizes"][0] for c in found if c is not None and len(c["sizes"])), None)
    named = np.array([c is not None for c in found])
    statuses = [c["status"] for c in found if c is not None]
    status = max(set(statuses), key=statuses.count)
    if main is None:
        return Naming(joint, name, "cause", rows, time_s, named, status=status)
    null = NULLS.get(main["name"], 0.0)
    sizes = np.array([_size(c, main["name"]) if c is not None else (np.nan,) * 3 for c in found])
    size, sd = sizes[:, 0] - null, (sizes[:, 2] - sizes[:, 1]) / 3.92
    gain = np.array([float(c["gain"]) if c is not None else np.nan for c in found])
    limit = np.nan if main["name"] in ENDLESS else _limit(np.abs(size), gain)
    return Naming(
        joint, name, "cause", rows, time_s, named, main["name"], str(main["unit"]), size, sd, status, limit
    )


def _size(cause: Mapping[str, Any], parameter: str) -> tuple[float, float, float]:
    for s in cause["sizes"]:
        if s["name"] == parameter:
            return float(s["value"]), float(s["low"]), float(s["high"])
    return (float("nan"),) * 3


def _limit(size: FloatArray, gain: FloatArray) -> float:
    """Return the detection limit: the size that would have had the least gain that is named.

    A cause of size s leaves a residual of sqrt(noise² + (k s)²) where it is not modelled; k from its gain, in
    the recordings that show it best, since a gain beside other causes means less. At most the least named
    size.
    """
    usable = np.isfinite(size) & (gain > _LEAST_GAIN) & (gain < 1.0)
    if not np.any(usable):
        return float("nan")
    of_noise = np.sqrt(1.0 / (1.0 - gain[usable]) ** 2 - 1.0)
    least = np.sqrt(1.0 / (1.0 - _LEAST_GAIN) ** 2 - 1.0)
    smallest = np.quantile(size[usable] / of_noise, _BEST) * least
    return float(min(smallest, np.quantile(size[usable], _BEST)))


def cause_sizes(every: Sequence[Naming], history: Table, recordings: Table) -> Iterator[Series]:
    """Yield the sizes of each cause that has one, less its null, in the recordings that name it.

    Temperatures, °C, are those of the history; NaN where unknown.
    """
    keys = zip(history["joint"], history["recording"], strict=True)
    temperature = dict(zip(keys, np.asarray(history["temperature"], float), strict=True))
    for n in every:
        if n.size is None or n.sd is None:
            continue
        recording, artefacts = (np.asarray(recordings[c])[n.row[n.named]] for c in ("recording", "artefacts"))
        warm = np.array([temperature.get((n.joint, r), np.nan) for r in recording], float)
        known, sd = np.isfinite(n.size) & np.isfinite(n.sd), np.maximum(n.sd, 1e-9)
        yield Series(
            n.joint, f"{n.about}.{n.parameter}", n.unit, n.time_s[n.named], n.size[n.named], sd[n.named],
            known[n.named], warm, recording, artefacts,
        )  # fmt: skip
