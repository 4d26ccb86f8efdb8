"""Causes that appear, and whether that is significant."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri, stdtr
from scipy.stats import false_discovery_control, t

from rsea_extras.trends.result import Alarm, Growth, Interval, Trend
from rsea_extras.trends.series import DAY, Naming, Table, TrendSettings
from rsea_ros.extension.base import MAD_TO_SD, Z95, FloatArray

_SMALLEST = 1e-280
_SUREST = 37.0
"""Normal score whose tail is the least that a double holds: rarer ones count as that rare."""
_KINDS = 2
"""A scan looks for steps and for ramps."""


def scan_p(largest: float, share: float, freedom: int) -> float:
    """Return how often noise alone makes a scan's largest |z| so large.

    share: of the days at each end where no change is looked for. freedom: of the estimated noise.
    Tail of the maximum of a standardised bridge (Miller and Siegmund 1982), for each kind of term.
    """
    b = min(_as_normal(abs(largest), freedom), _SUREST)
    if b < 1.5:
        return 1.0
    density = np.exp(-0.5 * b * b) / np.sqrt(2.0 * np.pi)
    rate = density * ((b - 1.0 / b) * np.log((1.0 - share) ** 2 / share**2) + 4.0 / b)
    return float(min(1.0, _KINDS * rate))


@lru_cache(maxsize=4096)
def scan_threshold(rate: float, share: float, freedom: int) -> float:
    """Return the |z| that noise alone reaches with a probability of `rate`."""
    return float(brentq(lambda z: np.log(scan_p(z, share, freedom) / rate), 1.6, 200.0))


def adjust(p: FloatArray) -> FloatArray:
    """Return for each p value the false discovery rate at which it counts (Benjamini and Hochberg 1995).

    p: shape (n,). Findings of one joint depend on each other, positively, under which the rate still holds
    (Benjamini and Yekutieli 2001, theorem 1.2).
    """
    return np.asarray(false_discovery_control(p))


def _as_normal(score: float, freedom: int) -> float:
    """Return the normal score that is as rare as one of a Student variable."""
    tail = float(stdtr(freedom, -score))
    return float(-ndtri(tail)) if tail > _SMALLEST else float(np.sqrt(-2.0 * t.logsf(score, freedom)))


_LESS_BEFORE = 3.0
"""Log likelihood ratio, odds of 20, from which a joint is said to have been without it before."""
_MOSTLY, _RARELY = 0.5, 0.25
"""Share of the days that name what a joint always had, at least, and in its fleet, at most."""
_LATEST_DAYS = 3
"""Days whose sizes stand for a cause's present size, where they have no course: as many as name it first."""
_SURE = 0.98
"""Highest share of days that is assumed to name anything: a diagnosis may miss."""


@dataclass(frozen=True)
class Scan:
    """The days of a naming: mean time (days since 1970) and whether most recordings name it, shape (n,).

    ratio: log likelihood of `named more often from this day on` over `as often as before`, shape (n,).
    """

    naming: Naming
    t: FloatArray
    named: FloatArray
    ratio: FloatArray
    p: float


def appearances(
    every: Sequence[Naming], joints: int, recordings: Table, sizes: Mapping[tuple[str, str], Trend],
    settings: TrendSettings,
) -> Iterator[Alarm]:  # fmt: skip
    """Yield causes and faults that appeared, or that one joint but not the fleet has from the first day.

    joints: how many the fleet has. sizes: trends of the causes' sizes, by joint and `cause.parameter`.
    p values are bounded by the number of days times exp(-ratio).
    """
    usual = _usual(every, joints, settings)
    scans = [_scan(n, usual[n.kind, n.about], settings) for n in every]
    q = adjust(np.array([s.p for s in scans]))
    for scan, rate in zip(scans, q, strict=True):
        if rate <= settings.false_discovery and len(scan.t):
            size = sizes.get((scan.naming.joint, f"{scan.naming.about}.{scan.naming.parameter}"))
            yield _appearance(scan, float(rate), recordings, size, settings)


def _usual(every: Sequence[Naming], joints: int, settings: TrendSettings) -> dict[tuple[str, str], float]:
    """Return by kind and name the share of recordings that name it in the median joint."""
    shares: dict[tuple[str, str], list[float]] = {}
    for n in every:
        shares.setdefault((n.kind, n.about), []).append(float(np.mean(n.named)))
    if joints < settings.fewest_joints:
        return dict.fromkeys(shares, settings.background)
    medians = {key: np.median(v + [0.0] * (joints - len(v))) for key, v in shares.items()}
    return {key: max(settings.background, float(median)) for key, median in medians.items()}


def _scan(n: Naming, usual: float, settings: TrendSettings) -> Scan:
    day = np.floor(n.time_s / DAY)
    starts = np.flatnonzero(np.diff(day, prepend=-np.inf))
    count = np.diff([*starts, len(day)])
    named = (np.add.reduceat(n.named.astype(float), starts) / count >= 0.5).astype(float)
    t = np.add.reduceat(n.time_s, starts) / count / DAY
    ratio = _ratios(named, min(usual, _SURE))
    later = np.cumsum(named[::-1])[::-1]
    ratio[later < settings.fewest_named] = 0.0
    always = _always(named, usual) if np.sum(named) >= settings.fewest_named else 0.0
    most = max(float(np.max(ratio, initial=0.0)), always)
    return Scan(n, t, named, ratio, float(min(1.0, len(t) * np.exp(-most))))


def _always(named: FloatArray, usual: float) -> float:
    """Return the log likelihood ratio of a joint with a cause that its fleet lacks, 0 if not clear."""
    share = float(np.mean(named))
    if share < _MOSTLY or usual > _RARELY:
        return 0.0
    k, n = float(np.sum(named)), float(len(named))
    return float(_likelihood(k, n, share) - _likelihood(k, n, usual))


def _ratios(named: FloatArray, usual: float) -> FloatArray:
    """Return the log likelihood ratio of more naming from each day on, 0 where it is not more, shape (n,)."""
    n = len(named)
    before_n, before = np.arange(n, dtype=float), np.cumsum(named) - named
    after_n, after = n - before_n, np.sum(named) - before
    share = np.clip(after / after_n, 1e-9, _SURE)
    earlier = np.maximum(before / np.maximum(before_n, 1.0), usual)
    whole = max(float(np.mean(named)), usual) if n else usual
    split = _likelihood(after, after_n, share) + _likelihood(before, before_n, earlier)
    ratio: FloatArray = split - _likelihood(float(np.sum(named)), float(n), whole)
    return np.where(share > earlier, np.maximum(ratio, 0.0), 0.0)


def _likelihood(k: FloatArray | float, n: FloatArray | float, p: FloatArray | float) -> FloatArray:
    """Return the log likelihood of k days of n that name it, each with probability p."""
    q = np.clip(p, 1e-9, _SURE)
    return np.asarray(k * np.log(q) + (n - k) * np.log(1.0 - q))


def _appearance(
    scan: Scan, q: float, recordings: Table, sizes: Trend | None, settings: TrendSettings
) -> Alarm:
    n, t = scan.naming, scan.t
    from_first = float(np.max(scan.ratio)) < _LESS_BEFORE
    best = 0 if from_first else int(np.argmax(scan.ratio))
    first = best + int(np.argmax(scan.named[best:] > 0.0))
    earliest, since, latest = (t[first],) * 3 if from_first else _dates(scan, best, first, settings)
    row = int(n.row[np.flatnonzero((n.time_s >= np.floor(t[first]) * DAY) & n.named)[0]])
    size, growth = _present_size(n, sizes)
    return Alarm(
        f"{n.joint}/{n.about}/{n.kind}", n.joint, n.about, n.kind, since * DAY, earliest * DAY, latest * DAY,
        size, n.unit, float("nan"), 1.0 - q, str(recordings["recording"][row]),
        str(recordings["artefacts"][row]), float(np.mean(scan.named[first:])), from_first, growth, n.status,
    )  # fmt: skip


def _dates(scan: Scan, best: int, first: int, settings: TrendSettings) -> tuple[float, float, float]:
    """Return the earliest, the likeliest and the latest beginning, days since 1970."""
    t = scan.t
    likely = np.flatnonzero(scan.ratio >= scan.ratio[best] - 0.5 * settings.date_doubt)
    since = 0.5 * float(t[max(0, first - 1)] + t[first])
    earliest = float(t[max(0, int(likely[0]) - 1)])
    return min(earliest, since), since, max(float(t[likely[-1]]), since)


def _present_size(n: Naming, trend: Trend | None) -> tuple[Interval | None, Growth]:
    """Return the size of a cause now, and its growth, from the course of its sizes.

    Without a course the median of the sizes on the last days that name it, only a few days: a size may grow.
    Its interval holds their scatter and their own doubt.
    """
    if trend is not None and trend.now is not None and trend.per_year is not None:
        outwards = trend.per_year.value * trend.now.value > 0.0
        return trend.now, "" if trend.state != "trending" else "growing" if outwards else "shrinking"
    usable = np.flatnonzero(n.named & np.isfinite(n.size)) if n.size is not None else np.empty(0)
    if n.size is None or n.sd is None or not len(usable):
        return None, ""
    days = np.floor(n.time_s[usable] / DAY)
    usable = usable[days >= np.unique(days)[-_LATEST_DAYS:][0]]
    size, sd = n.size[usable], n.sd[usable]
    middle = float(np.median(size))
    spread = MAD_TO_SD * float(np.median(np.abs(size - middle)))
    half = Z95 * 1.25 * float(np.hypot(spread, np.median(sd))) / np.sqrt(len(usable))
    return Interval(middle, middle - half, middle + half), ""
