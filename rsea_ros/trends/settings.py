"""Every number that steers a trend, a change or an alarm: its unit, and why it has this value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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
