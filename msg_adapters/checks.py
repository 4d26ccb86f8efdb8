"""What is refused before a model is fitted to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.errors import BagError
from rsea_ros.signals import FloatArray, IntArray


@dataclass(frozen=True)
class Series:
    """One field of one topic: stamps in ns and values, both (n,); `where` is file, topic and field."""

    where: str
    stamps: IntArray
    values: FloatArray


def checked(series: Series, notes: list[str]) -> Series:
    """Return the series without repeated stamps, of which the first is kept and a note is left.

    Raises BagError for a value that is not finite and for a stamp that goes back.
    """
    _finite(series)
    _forward(series)
    keep = np.diff(series.stamps, prepend=series.stamps[0] - 1) > 0
    if not keep.all():
        repeats = np.count_nonzero(~keep)
        notes.append(f"{series.where}: {repeats} of {keep.size} stamps repeat, the first of each kept")
    return Series(series.where, series.stamps[keep], series.values[keep])


def _finite(series: Series) -> None:
    bad = np.flatnonzero(~np.isfinite(series.values))
    if bad.size:
        at = bad[0]
        raise BagError(
            f"{series.where}[{at}] is {series.values[at]} at {_seconds(series.stamps[at])},"
            f" expected a finite number ({bad.size} of {series.values.size} are not)"
        )


def _forward(series: Series) -> None:
    steps = np.diff(series.stamps)
    bad = np.flatnonzero(steps < 0)
    if bad.size:
        at = bad[0] + 1
        raise BagError(
            f"{series.where}[{at}] is stamped {_seconds(series.stamps[at])}, {-steps[at - 1] * 1e-9:.6f} s"
            f" before its predecessor, expected stamps that never go back ({bad.size} do)"
        )


def _seconds(stamp: np.int64) -> str:
    return f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d} s"
