"""Pictures of a fleet as wide as the page: joints × weeks, and a bar for each finding from its day on."""

import math
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from html import escape

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.report.fleet import words as say
from rsea_ros.report.page import Html, section
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.result import FleetTrends, Steps, Trend, bin_days
from rsea_ros.trends.series import BoolArray

_ROW = 17
"""Pixels of a row, as in fleet.css."""
_SHADES = 8
_QUANTILE, _NOISE, _LEAST = 0.995, 8.0, 0.01
"""Colours are full at this quantile of the changes, at so many times their median, and at 1 %, at least."""
_OFTEN = 0.5
"""Share of the recordings of a step that counts as often."""
_MOST = 24
"""Findings of the timeline."""
_MONTHS = 6
"""Months that find room on a phone."""
_BEGIN, _END = 6.0, 96.0
"""Percent of the width: a name before _BEGIN starts at its place, one behind _END has no room."""
_STRIDES = (1, 2, 3, 6, 12, 24, 60, 120)


def heat_map(
    parameter: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps, links: say.Links
) -> Html:
    """Return the section of a parameter, the first joint on top; grey if not determined."""
    rows = [fleet.trends.get((joint, parameter), fleet.sizes.get((joint, parameter))) for joint in joints]
    shown = [_row(trend, steps) for trend in rows]
    change, undetermined = np.array([c for c, _ in shown]), np.array([u for _, u in shown])
    sizes, full = np.abs(change[np.isfinite(change)]), 1.0
    if sizes.size:  # noise alone stays pale
        full = float(max(_LEAST, np.quantile(sizes, _QUANTILE), _NOISE * np.median(sizes)))

    def text(i: int, j: int) -> str:
        if np.isfinite(change[i, j]):
            return say.percent(float(change[i, j]))
        trend = rows[i]
        return say.undetermined_state(trend) if trend and trend.state == "undetermined" else "not determined"

    determined = [t for t in rows if t is not None and t.state != "undetermined"]
    moved = [t for t in determined if t.state != "steady"]
    which = f"all {len(determined)} joints that determine it" if len(determined) > 1 else "one joint"
    title = f"{say.name(parameter)}: steady in {which}"
    if moved:
        most = max(moved, key=lambda t: abs(t.relative))
        where = f"{len(moved)} of {len(determined)} joints, most in {most.series.joint}"
        title = f"{say.name(parameter)}: changed in {where}, by {say.percent(most.relative)}"
    return section(
        title,
        _picture(change / full, undetermined, joints, steps, links, text),
        _key(say.percent(-full), say.percent(full), (-1.0, 1.0), ", middle: as on the first day"),
        caption=f"Mean of each {steps.name} against the joint's first level, at its mean temperature. Grey: "
        "recordings that do not determine it, or of too few days for a level. Empty: no recording.",
    )


def naming_map(
    subject: str, kind: str, joints: Sequence[str], fleet: FleetTrends, steps: Steps, links: say.Links
) -> Html:
    """Return the section of a cause or a fault: the share of each week's recordings that name it."""
    of = {n.joint: n for n in fleet.namings if (n.about, n.kind) == (subject, kind)}
    asked = np.array([steps.count(of[j].time_s) for j in joints])
    named = np.array([steps.count(of[j].time_s[of[j].named]) for j in joints])
    share: FloatArray = np.where(asked > 0, named / np.maximum(asked, 1), np.nan)
    often = int(np.sum(np.any(share >= _OFTEN, axis=1)))
    plain = say.name(subject) + ("" if kind == "cause" else " in the data")
    nothing = np.zeros(share.shape, bool)
    return section(
        f"{plain}: often in {often} of {len(fleet.joints)} joints",
        _picture(share, nothing, joints, steps, links, lambda i, j: f"{share[i, j]:.0%} of its recordings"),
        _key("no recording", f"all recordings of the {steps.name}", (0.0, 1.0)),
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


def _picture(
    depth: FloatArray, undetermined: BoolArray, joints: Sequence[str], steps: Steps, links: say.Links,
    text: Callable[[int, int], str],
) -> Html:  # fmt: skip
    """Return the cells. depth: -1 to 1, NaN for none, shape (joints, steps). text: of a cell."""
    cells = []
    for i, j in np.argwhere(np.isfinite(depth) | undetermined).tolist():
        shade = "n" if undetermined[i, j] else _class(float(depth[i, j]))
        spoken = escape(f"{joints[i]}, {say.short_day(float(steps.edges[j]))}: {text(i, j)}")
        look = f' class="{shade}"' if shade else ""
        cells.append(f'<rect x="{j}" y="{i}" width=".92" height=".86"{look}><title>{spoken}</title></rect>')
    labels = "".join(f"<li>{links.joint(j)}</li>" for j in joints)
    return Html(
        f'<div class="heat"><ol>{labels}</ol>'
        f'<svg viewBox="0 0 {len(steps)} {len(joints)}" preserveAspectRatio="none" '
        f'style="height:{_ROW * len(joints)}px" role="img">{"".join(cells)}</svg>{_months(steps)}</div>'
    )


def _class(depth: float) -> str:
    shade = round(min(1.0, abs(depth)) * _SHADES)
    return f"{'u' if depth > 0.0 else 'd'}{shade}" if shade else ""


def _key(low: str, high: str, ends: tuple[float, float], middle: str = "") -> Html:
    steps = np.linspace(*ends, 2 * _SHADES + 1)
    cells = "".join(
        f'<rect x="{k}" width="1" height="1" class="{_class(float(v)) or "z"}"/>' for k, v in enumerate(steps)
    )
    scale = f'<svg viewBox="0 0 {len(steps)} 1" preserveAspectRatio="none">{cells}</svg>'
    return Html(f'<div class="key">{escape(low)}{scale}{escape(high)}{middle}</div>')


def timeline(alarms: Sequence[Alarm], steps: Steps, links: say.Links) -> Html:
    """Return the section of the findings that have a date, in the order given; empty without one."""
    dated = [a for a in alarms if math.isfinite(a.since_s)]
    if not dated:
        return Html()
    rows = []
    for a in dated[:_MOST]:
        early, begin, late = (_place(t, steps) for t in (a.earliest_s, a.since_s, a.latest_s))
        rows.append(
            f'<div class="span {a.kind}"><p>{links.joint(a.joint)} {escape(say.about(a))}'
            f"<small>began {escape(say.doubt_of_date(a))}</small></p>"
            f'<div class="rail"><i class="doubt" style="left:{early:.1f}%;width:{late - early:.1f}%"></i>'
            f'<i style="left:{begin:.1f}%;width:{100.0 - begin:.1f}%"></i></div></div>'
        )
    first = say.short_day(min(a.since_s for a in dated[:_MOST]))
    number = "one finding" if len(dated) == 1 else f"{len(dated)} findings"
    more = f" The first {_MOST} of {len(dated)} findings." if len(dated) > _MOST else ""
    return section(
        f"What changed since when: {number}, the earliest of {first}",
        Html(f'<div class="spans">{"".join(rows)}{_months(steps)}</div>'),
        caption="A bar begins on the day of the change, pale if that day is uncertain, or with the first "
        "recording if that shows it. Orange: it continues, or has a name. Blue: the change is over, its "
        f"level stays. Grey: bad data.{more}",
    )


def _place(time_s: float, steps: Steps) -> float:
    first, last = float(steps.edges[0]), float(steps.edges[-1])
    return min(100.0, max(0.0, 100.0 * (time_s - first) / (last - first)))


def _months(steps: Steps) -> str:
    """Return the names of months at their places below a picture; of days where all lies in two months."""
    first, last = (datetime.fromtimestamp(float(t), timezone.utc) for t in (steps.edges[0], steps.edges[-1]))
    whole = 12 * (last.year - first.year) + last.month - first.month
    marks = [(float(steps.edges[0]), say.short_day(float(steps.edges[0])))]
    if whole >= 2:
        stride = next((s for s in _STRIDES if whole / s <= _MONTHS), _STRIDES[-1])
        every = [12 * first.year + first.month - 1 + k for k in range(1, whole + 1)]
        starts = [datetime(m // 12, m % 12 + 1, 1, tzinfo=timezone.utc) for m in every if m % stride == 0]
        starts = [t for t in starts if _place(t.timestamp(), steps) < _END]
        marks = []
        for t in starts:  # with its year below the first and each January
            _, month, year = say.short_day(t.timestamp()).split()
            marks.append((t.timestamp(), f"{month}\n{year}" if t is starts[0] or t.month == 1 else month))
    spans = ""
    for time_s, text in marks:
        x = _place(time_s, steps)
        edge = ' class="edge"' if x < _BEGIN else ""
        spans += f'<span{edge} style="left:{x:.1f}%">{text}</span>'
    return f'<div class="months">{spans}</div>'
