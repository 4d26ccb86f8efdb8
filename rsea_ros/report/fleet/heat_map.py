"""Joints × weeks: how far a parameter is from where each joint began."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.report.figure import Figure, Json, axis, layout, numbers
from rsea_ros.report.fleet.fleet_words import dates, name, percent
from rsea_ros.report.fleet.marks import date_axis
from rsea_ros.report.palette import AFTER, BEFORE, GRID, NOISE, QUIET, faint
from rsea_ros.trends.causes import Naming
from rsea_ros.trends.result import FleetTrends, Trend
from rsea_ros.trends.weeks import Steps, binned

_ROW, _MARGIN = 17, 92
_QUANTILE = 0.995
_NOISE = 8.0
"""Times the median change."""
_OFTEN = 50.0
"""% of a week's recordings."""
_LEAST = 0.01
"""Relative change at which the colours are full, at least."""


def heat_map(parameter: str, joints: Sequence[str], found: FleetTrends, steps: Steps) -> Figure:
    """Return the map of a parameter, the first joint on top; grey where recordings could not tell."""
    rows = [found.trends.get((joint, parameter), found.sizes.get((joint, parameter))) for joint in joints]
    shown = [_row(trend, steps) for trend in rows]
    change = np.array([c for c, _ in shown]) * 100.0
    untold = np.array([u for _, u in shown])
    finite = np.abs(change[np.isfinite(change)])
    full = _full(finite) if finite.size else 1.0
    x, names = dates(steps.middle), list(joints)
    return Figure(
        title=_title(parameter, rows),
        caption="Mean of each week against the joint's first level, at its mean temperature. Orange: higher. "
        "Blue: lower. Grey: recordings, but none that could tell. Empty: no recording.",
        data=[_untold(untold, x, names), _changes(change, x, names, full)],
        layout=layout(
            xaxis=date_axis(steps),
            yaxis=axis("", type="category", autorange="reversed", showgrid=False, ticks="", dtick=1),
            hovermode="closest",
            margin={"l": 60, "r": 84, "t": 8, "b": 36},
        ),
        height=_MARGIN + _ROW * len(joints),
    )


def _full(change: np.ndarray) -> float:
    """Return the change, %, at which the colours are full: noise alone stays pale."""
    return float(max(100.0 * _LEAST, np.quantile(change, _QUANTILE), _NOISE * np.median(change)))


def naming_map(about: str, kind: str, joints: Sequence[str], found: FleetTrends, steps: Steps) -> Figure:
    """Return the map of a cause or a fault: the share of each week's recordings that name it."""
    of = {n.joint: n for n in found.namings if (n.about, n.kind) == (about, kind)}
    share = np.array([_share(of.get(joint), steps) for joint in joints]) * 100.0
    plain = name(about) + ("" if kind == "cause" else " in the data")
    often = [j for j, row in zip(joints, share, strict=True) if np.nanmax(row, initial=0.0) >= _OFTEN]
    return Figure(
        title=f"{plain}: {len(often)} of {len(joints)} joints",
        caption=f"Share of the recordings of each week that name it, for joints that do at all; "
        f"counted: {_OFTEN:g} % or more in some week.",
        data=[_shares(share, dates(steps.middle), list(joints))],
        layout=layout(
            xaxis=date_axis(steps),
            yaxis=axis("", type="category", autorange="reversed", showgrid=False, ticks="", dtick=1),
            hovermode="closest",
            margin={"l": 60, "r": 84, "t": 8, "b": 36},
        ),
        height=_MARGIN + _ROW * len(joints),
    )


def _share(naming: Naming | None, steps: Steps) -> np.ndarray:
    if naming is None:
        return np.full(len(steps), np.nan)
    asked, named = steps.count(naming.time_s), steps.count(naming.time_s[naming.named])
    return np.where(asked > 0, named / np.maximum(asked, 1), np.nan)


def _shares(share: np.ndarray, x: list[str], names: list[str]) -> Json:
    scale = [[0.0, faint(GRID, 0.5)], [1.0, BEFORE]]
    map_ = _changes(share, x, names, 100.0)
    hover = "%{y}, week of %{x}: named in %{z:.0f} %<extra></extra>"
    return {**map_, "zmin": 0.0, "colorscale": scale, "hovertemplate": hover}


def _row(trend: Trend | None, steps: Steps) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative change of each week, and which weeks were recorded and not told."""
    empty = np.full(len(steps), np.nan)
    if trend is None:
        return empty, np.zeros(len(steps), bool)
    bins = binned(trend, steps)
    if trend.first is None or not trend.first.value:
        return empty, bins.asked > 0
    change = (bins.value - trend.first.value) / abs(trend.first.value)
    return change, (bins.asked > 0) & ~np.isfinite(change)


def _changes(change: np.ndarray, x: list[str], names: list[str], full: float) -> Json:
    return {
        "type": "heatmap",
        "x": x,
        "y": names,
        "z": [numbers(row) for row in change],
        "zmin": -full,
        "zmax": full,
        "colorscale": [[0.0, AFTER], [0.5, faint(GRID, 0.5)], [1.0, BEFORE]],
        "xgap": 1,
        "ygap": 2,
        "hoverongaps": False,
        "hovertemplate": "%{y}, week of %{x}: %{z:+.2f} %<extra></extra>",
        "colorbar": {
            "thickness": 8, "len": 0.9, "outlinewidth": 0, "ticksuffix": " %", "x": 1.01, "nticks": 5,
            "tickfont": {"size": 11, "color": QUIET},
        },
    }  # fmt: skip


def _untold(untold: np.ndarray, x: list[str], names: list[str]) -> Json:
    return {
        "type": "heatmap",
        "x": x,
        "y": names,
        "z": [[1.0 if u else None for u in row] for row in untold],
        "colorscale": [[0.0, faint(NOISE, 0.55)], [1.0, faint(NOISE, 0.55)]],
        "showscale": False,
        "xgap": 1,
        "ygap": 2,
        "hoverongaps": False,
        "hovertemplate": "%{y}, week of %{x}: not enough excitation to tell<extra></extra>",
    }


def _title(parameter: str, rows: Sequence[Trend | None]) -> str:
    told = [t for t in rows if t is not None and t.state != "untold"]
    moved = [t for t in told if t.state != "steady"]
    plain = name(parameter)
    if not told:
        return f"{plain}: not enough excitation to tell in any joint"
    if not moved:
        return f"{plain} is steady in all {len(told)} joints that tell it"
    most = max(moved, key=lambda t: abs(t.relative))
    where = f"{len(moved)} of {len(told)} joints, most in {most.series.joint}"
    return f"{plain} moved in {where}: {percent(most.relative)}"
