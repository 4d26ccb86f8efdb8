"""Joints × weeks: how far a parameter is from where each joint began, how often a cause is named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.report.fleet.dates_below import months
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.words import name, percent, short_day, undetermined_state
from rsea_ros.report.page.html import section
from rsea_ros.trends.cause_series import Naming
from rsea_ros.trends.result import FleetTrends, Trend
from rsea_ros.trends.series import BoolArray
from rsea_ros.trends.weeks import Steps, bin_days

_ROW = 17
"""Pixels of a row, as in fleet.css."""
_SHADES = 8
_QUANTILE, _NOISE, _LEAST = 0.995, 8.0, 0.01
"""Colours are full at this quantile of the changes, at so many times their median, and at 1 %, at least."""
_OFTEN = 0.5
"""Share of the recordings of a step that counts as often."""


def heat_map(parameter: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps, links: Links) -> str:
    """Return the section of a parameter, the first joint on top; grey if not determined."""
    rows = [fleet.trends.get((joint, parameter), fleet.sizes.get((joint, parameter))) for joint in joints]
    shown = [_row(trend, steps) for trend in rows]
    change, undetermined = np.array([c for c, _ in shown]), np.array([u for _, u in shown])
    full = _full(np.abs(change[np.isfinite(change)]))
    picture = _picture(
        change / full, undetermined, joints, steps, links,
        lambda i, j: percent(float(change[i, j])) if np.isfinite(change[i, j]) else _why_blank(rows[i]),
    )  # fmt: skip
    return section(
        _title(parameter, rows),
        picture,
        _key(percent(-full), "as on the first day", percent(full), (-1.0, 1.0)),
        caption=f"Mean of each {steps.name} against the joint's first level, at its mean temperature. Grey: "
        "recordings that do not determine it, or of too few days for a level. Empty: no recording.",
    )


def naming_map(
    about: str, kind: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps, links: Links
) -> str:
    """Return the section of a cause or a fault: the share of each week's recordings that name it."""
    of = {n.joint: n for n in fleet.namings if (n.about, n.kind) == (about, kind)}
    share = np.array([_share(of[joint], steps) for joint in joints])
    often = sum(bool(np.nanmax(row, initial=0.0) >= _OFTEN) for row in share)
    picture = _picture(
        share,
        np.zeros(share.shape, bool),
        joints,
        steps,
        links,
        lambda i, j: f"{share[i, j]:.0%} of its recordings",
    )
    plain = name(about) + ("" if kind == "cause" else " in the data")
    return section(
        f"{plain}: often in {often} of {len(fleet.joints)} joints",
        picture,
        _key("no recording", "", f"all recordings of the {steps.name}", (0.0, 1.0)),
        caption=f"Share of the recordings of each {steps.name} that name it, for joints with at least one.",
    )


def shades() -> str:
    """Return the style of the cells: orange above, blue below, by steps of the change."""
    opacity = [0.04 + 0.96 * (k / _SHADES) ** 1.4 for k in range(1, _SHADES + 1)]
    return "".join(
        f".heat .{side}{k},.key .{side}{k}{{fill:var(--{tone});fill-opacity:{o:.2f}}}"
        for side, tone in (("u", "before"), ("d", "after"))
        for k, o in enumerate(opacity, 1)
    )


def _full(change: FloatArray) -> float:
    """Return the change at which the colours are full: noise alone stays pale."""
    if not change.size:
        return 1.0
    return float(max(_LEAST, np.quantile(change, _QUANTILE), _NOISE * np.median(change)))


def _row(trend: Trend | None, steps: Steps) -> tuple[FloatArray, BoolArray]:
    """Return the relative change of each week, and which weeks were recorded and not determined."""
    empty = np.full(len(steps), np.nan)
    if trend is None:
        return empty, np.zeros(len(steps), bool)
    bins = bin_days(trend, steps)
    if trend.first is None or not trend.first.value:
        return empty, bins.recorded > 0
    change: FloatArray = (bins.value - trend.first.value) / abs(trend.first.value)
    return change, (bins.recorded > 0) & ~np.isfinite(change)


def _why_blank(trend: Trend | None) -> str:
    """Return why a week with recordings has no level to compare."""
    if trend is None or trend.state != "undetermined":
        return "not determined"
    return undetermined_state(trend)


def _share(naming: Naming, steps: Steps) -> FloatArray:
    asked, named = steps.count(naming.time_s), steps.count(naming.time_s[naming.named])
    share: FloatArray = np.where(asked > 0, named / np.maximum(asked, 1), np.nan)
    return share


def _picture(
    depth: FloatArray, undetermined: BoolArray, joints: Sequence[str], steps: Steps, links: Links,
    text: Callable[[int, int], str],
) -> str:  # fmt: skip
    """Return the cells. depth: -1 to 1, NaN for none, shape (joints, steps). text: of a cell."""
    weeks = [short_day(float(t)) for t in steps.edges[:-1]]
    cells = []
    for i, joint in enumerate(joints):
        for j in np.flatnonzero(np.isfinite(depth[i]) | undetermined[i]):
            blank = bool(undetermined[i, j])
            shade = "n" if blank else _class(float(depth[i, j]))
            cells.append(_cell(i, int(j), shade, f"{joint}, {weeks[j]}: {text(i, int(j))}"))
    height = _ROW * len(joints)
    labels = "".join(f"<li>{links.joint(j)}</li>" for j in joints)
    return (
        f'<div class="heat"><ol>{labels}</ol>'
        f'<svg viewBox="0 0 {len(steps)} {len(joints)}" preserveAspectRatio="none" style="height:{height}px" '
        f'role="img">{"".join(cells)}</svg>{months(steps)}</div>'
    )


def _cell(row: int, column: int, kind: str, text: str) -> str:
    of_class = f' class="{kind}"' if kind else ""
    place = f'x="{column}" y="{row}" width=".92" height=".86"'
    return f"<rect {place}{of_class}><title>{escape(text)}</title></rect>"


def _class(depth: float) -> str:
    shade = round(min(1.0, abs(depth)) * _SHADES)
    return f"{'u' if depth > 0.0 else 'd'}{shade}" if shade else ""


def _key(low: str, middle: str, high: str, ends: tuple[float, float]) -> str:
    """Return the scale of colours with its ends."""
    steps = np.linspace(*ends, 2 * _SHADES + 1)
    cells = "".join(
        f'<rect x="{k}" width="1" height="1" class="{_class(float(v)) or "z"}"/>' for k, v in enumerate(steps)
    )
    scale = f'<svg viewBox="0 0 {len(steps)} 1" preserveAspectRatio="none">{cells}</svg>'
    inner = f", middle: {escape(middle)}" if middle else ""
    return f'<div class="key">{escape(low)}{scale}{escape(high)}{inner}</div>'


def _title(parameter: str, rows: Sequence[Trend | None]) -> str:
    determined = [t for t in rows if t is not None and t.state != "undetermined"]
    moved = [t for t in determined if t.state != "steady"]
    if not moved:
        which = f"all {len(determined)} joints that determine it" if len(determined) > 1 else "one joint"
        return f"{name(parameter)}: steady in {which}"
    most = max(moved, key=lambda t: abs(t.relative))
    where = f"{len(moved)} of {len(determined)} joints, most in {most.series.joint}"
    return f"{name(parameter)}: changed in {where}, by {percent(most.relative)}"
