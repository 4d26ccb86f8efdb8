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


def check_finite(series: Series) -> None:
    """Raises BagError for a value that is not finite."""
    bad = np.flatnonzero(~np.isfinite(series.values))
    if bad.size:
        at = bad[0]
        raise BagError(
            f"{series.where}[{at}] is {series.values[at]} at {_seconds(series.stamps[at])},"
            f" expected a finite number ({bad.size} of {series.values.size} are not)"
        )


def note_repeats(series: Series, notes: list[str]) -> None:
    """Leave a note of stamps that repeat."""
    repeats = np.count_nonzero(np.diff(np.sort(series.stamps)) == 0)
    if repeats:
        total = series.stamps.size
        notes.append(f"{series.where}: {repeats} of {total} stamps repeat, the first of each kept")


def _seconds(stamp: np.int64) -> str:
    return f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d} s"
