"""Joints unlike the others of their fleet, by a robust score over their intervals."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rsea_ros.records.normal import MAD_TO_SD, Z95
from rsea_ros.trends.result import Outlier, Trend
from rsea_ros.trends.settings import TrendSettings
from rsea_ros.trends.significance import adjust, two_sided_p


def outliers(trends: Iterable[Trend], settings: TrendSettings) -> tuple[Outlier, ...]:
    """Return the joints whose present level is far from the fleet's median, in spreads of the fleet.

    Spread: median absolute deviation of the others' levels, together with the joint's own doubt.
    """
    groups: dict[tuple[str, str], list[Trend]] = {}
    for trend in trends:
        if trend.now is not None:
            groups.setdefault((trend.series.parameter, trend.series.unit), []).append(trend)
    scored = [s for group in groups.values() if len(group) >= settings.fewest_joints for s in _score(group)]
    if not scored:
        return ()
    q = adjust(np.array([two_sided_p(score, len_ - 1.0) for _, _, score, len_ in scored]))
    return tuple(
        Outlier(t.series.joint, t.series.parameter, t.series.unit, t.now, median, score, float(rate))
        for (t, median, score, _), rate in zip(scored, q, strict=True)
        if t.now is not None and abs(score) >= settings.outlier_joint and rate <= settings.false_discovery
    )


def _score(group: list[Trend]) -> list[tuple[Trend, float, float, int]]:
    levels = np.array([t.now.value for t in group if t.now is not None])
    half = np.array([t.now.high - t.now.low for t in group if t.now is not None]) / (2.0 * Z95)
    median = float(np.median(levels))
    spread = MAD_TO_SD * float(np.median(np.abs(levels - median)))
    scores = (levels - median) / np.sqrt(spread**2 + half**2 + 1e-300)
    return [(t, median, float(s), len(group)) for t, s in zip(group, scores, strict=True)]
