"""Faults of the data in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.documents.wording import list_names
from rsea_ros.records.record import MASKED, Fault
from rsea_ros.report import words


def fault(*alike: Fault) -> str:
    """Return `outliers in F/T torque, 0.04 % of the samples`.

    alike: the same fault of several channels or records.
    """
    f, channels = alike[0], list(dict.fromkeys(f.channel for f in alike))
    names = list_names([words.channel(channel) for channel in channels])
    if f.kind == "missing_topic":
        return f"{names} {'are' if len(channels) > 1 else 'is'} missing"
    detail = f" ({f.detail})" if f.detail else ""
    place = f" in {names}" if f.channel else ""
    return f"{_kind(f)}{place}{_size(f)}{detail}"


def fault_lines(items: Sequence[Fault]) -> list[str]:
    """Return one line for the faults of a kind that are equally large in several channels."""
    groups: dict[tuple[str, str, str], list[Fault]] = {}
    for f in items:
        groups.setdefault((f.kind, _size(f), f.detail), []).append(f)
    return [fault(*alike) for alike in groups.values()]


def faults(items: Sequence[Fault]) -> str:
    """Return all faults in a short sentence, those apart whose samples are masked."""
    left, masked = (
        _by_channel([f for f in items if (f.kind in MASKED) == is_masked]) for is_masked in (0, 1)
    )
    return " ".join(
        f"{opening}: {text}."
        for opening, text in (("Faults in the data", left), ("Faults in the data, masked", masked))
        if text
    )


def _by_channel(items: Sequence[Fault]) -> str:
    kinds: dict[str, list[str]] = {}
    for f in items:
        kinds.setdefault(f.channel, []).append(_kind(f))
    return "; ".join(
        f"{list_names(k)} in {words.channel(n)}" if n else list_names(k) for n, k in kinds.items()
    )


def _size(f: Fault) -> str:
    size = "" if f.size is None else f", {_number(f.size)} {words.unit(f.unit)}".rstrip()
    share = f", {words.number(100.0 * f.share, 2)} % of the samples" if math.isfinite(f.share) else ""
    return size + share


def _number(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() else words.number(value, 3)


def _kind(f: Fault) -> str:
    return "NaN" if f.kind == "nan" else f.kind.replace("_", " ")
