"""The numbers by which the interval of a fitted value is made (confidence.py)."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.documents.setting import number


@dataclass(frozen=True)
class IntervalSettings:
    """The blocks of the sandwich covariance, and its correction for a small number of them."""

    block: float = number(
        1.0, "s", "residuals further apart than this are taken as independent",
        "longer than a bench's memory, as blocks.longest",
    )  # fmt: skip
    most_corrected: float = number(
        4.0, "1", "largest factor n / (n - p) on the variance, for n blocks and p unknowns",
        "an interval twice as wide: with fewer than 4/3 p blocks the factor runs away",
    )  # fmt: skip


DEFAULT = IntervalSettings()
