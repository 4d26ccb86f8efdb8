"""Records that are refused before a model is fitted to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msg_adapters.contents import Contents
from rsea_ros.errors import BagError
from rsea_ros.records.record import Fault, FloatArray, IntArray


@dataclass(frozen=True)
class FieldSamples:
    """One field of one topic: stamps in ns and values, both (n,); `where` is file, topic and field."""

    where: str
    stamps: IntArray
    values: FloatArray


def check_finite(series: FieldSamples) -> None:
    """Raises BagError for a value that is not finite."""
    bad = np.flatnonzero(~np.isfinite(series.values))
    if bad.size:
        at = bad[0]
        raise BagError(
            f"{series.where}[{at}] is {series.values[at]} at {_seconds(series.stamps[at])},"
            f" expected a finite number ({bad.size} of {series.values.size} are not)"
        )


def note_repeats(series: FieldSamples, notes: list[str]) -> None:
    """Leave a note of stamps that repeat."""
    repeats = np.count_nonzero(np.diff(np.sort(series.stamps)) == 0)
    if repeats:
        total = series.stamps.size
        notes.append(f"{series.where}: {repeats} of {total} stamps repeat, the first of each kept")


def on_the_clock_of_the_command(
    series: Mapping[str, FieldSamples], report: Contents
) -> dict[str, FieldSamples]:
    """Leave out channels without a moment in common with the command: their stamps come from another clock.

    A simulation from the command's first stamp to their last would go through all the years between.
    """
    command = series.get("command")
    kept = {}
    for name, one in series.items():
        ahead = 0 if command is None else int(one.stamps.min()) - int(command.stamps.min())
        if command is None or _in_common(one.stamps, command.stamps):
            kept[name] = one
        else:
            detail = "left out: no moment in common with the command, its stamps are from another clock"
            report.faults.append(Fault("clock_offset", name, 1.0, detail, ahead * 1e-9, "s"))
    return kept


def _in_common(a: IntArray, b: IntArray) -> bool:
    return bool(max(a.min(), b.min()) <= min(a.max(), b.max()))


def _seconds(stamp: np.int64) -> str:
    return f"{stamp // 1_000_000_000}.{stamp % 1_000_000_000:09d} s"
