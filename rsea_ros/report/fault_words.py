"""Faults of the data in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.report import words
from rsea_ros.signals import Fault
from rsea_ros.wording import listed


def fault(f: Fault) -> str:
    """Return `outliers in F/T torque, 0.04 % of the samples`."""
    if f.kind == "missing_topic":
        return f"{words.channel(f.channel)} is missing"
    detail = f" ({f.detail})" if f.detail else ""
    size = "" if f.size is None else f", {words.number(f.size, 3)} {words.unit(f.unit)}"
    share = f", {words.number(100.0 * f.share, 2)} % of the samples" if math.isfinite(f.share) else ""
    return f"{_kind(f)} in {words.channel(f.channel)}{size}{share}{detail}"


def faults(items: Sequence[Fault]) -> str:
    """Return all faults in a short sentence."""
    kinds: dict[str, list[str]] = {}
    for f in items:
        kinds.setdefault(f.channel, []).append(_kind(f))
    parts = [f"{listed(k)} in {words.channel(n)}" for n, k in kinds.items()]
    return f"Faults in the data, masked: {'; '.join(parts)}."


def _kind(f: Fault) -> str:
    return "NaN" if f.kind == "nan" else f.kind.replace("_", " ")
