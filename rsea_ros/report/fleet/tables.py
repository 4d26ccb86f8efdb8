"""Tables of a fleet: findings, joints, undetermined parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.words import (
    amount,
    day,
    doubt_of_date,
    name,
    percent,
    sentence,
    undetermined_state,
    value,
)
from rsea_ros.report.page.html_table import table_of_cells
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.result import FleetTrends, Interval, Trend
from rsea_ros.trends.series import CLOCKS, Table

_STATES = {
    "steady": "steady",
    "changed": "changed",
    "trending": "going on",
}


def alarm_table(alarms: Sequence[Alarm], links: Links, with_joint: bool = True) -> str:
    """Return the findings with date, size, how sure, and the recording that shows each first."""
    head = ["Joint", "Finding", "Began", "#Size, 95 %", "#Sure", "Shown first by"]
    rows = [
        (
            links.joint(a.joint),
            escape(sentence(a)),
            escape(doubt_of_date(a)) or "–",
            escape(value(a.size, a.unit)) if a.size is not None else "–",
            _sure(a.confidence),
            links.recording(a.recording, a.artefacts) if a.recording else "–",
        )
        for a in alarms
    ]
    start = 0 if with_joint else 1
    return table_of_cells(head[start:], [r[start:] for r in rows])


def joint_table(
    joints: Sequence[str],
    fleet: FleetTrends,
    alarmed: Mapping[str, Sequence[Alarm]],
    latest: Mapping[str, str],
    recordings: Table,
    links: Links,
) -> str:
    """Return a row for each joint. latest: causes that its latest recording names."""
    head = [
        "Joint", "State", "#Recordings", "#Refused or broken", "#Parameters with a trend", "#Largest change",
    ]  # fmt: skip
    of = np.asarray(recordings["joint"], str)
    done = np.asarray(recordings["outcome"], str) == "done"
    dated = np.isfinite(np.asarray(recordings["time_s"], float))
    rows = []
    for joint in joints:
        trends = [t for (j, _), t in fleet.trends.items() if j == joint]
        determined = [t for t in trends if t.state != "undetermined"]
        rows_of_joint = of == joint
        moved = max((t.relative for t in determined if t.changes), key=abs, default=float("nan"))
        rows.append(
            (
                links.joint(joint),
                escape(_state(alarmed.get(joint, ()), determined, latest.get(joint, "")))
                if np.any(dated & rows_of_joint)
                else "no recording has a date",
                str(int(np.sum(rows_of_joint))),
                str(int(np.sum(rows_of_joint & ~done))),
                f"{len(determined)} of {len(trends)}",
                percent(moved) if moved == moved else "–",
            )
        )
    return table_of_cells(head, rows)


def _state(alarms: Sequence[Alarm], determined: Sequence[Trend], latest: str) -> str:
    """Return the changes; without any, the causes in the latest recording, or whether anything is known."""
    kinds = ", ".join(dict.fromkeys(a.kind for a in alarms))
    return kinds or (f"now {latest}" if latest else "steady" if determined else "too few dated recordings")


def parameter_rows(trends: Sequence[Trend]) -> str:
    """Return a row for each parameter of a joint: level, slope, scatter, least detectable step."""
    head = [
        "Parameter", "State", "#Now, 95 %", "#A year", "#Scatter of days", "#Smallest detectable step",
        "#Determined by",
    ]  # fmt: skip
    rows = []
    for t in trends:
        s = t.series
        level = abs(t.now.value) if t.now is not None and t.now.value else float("nan")
        slope = t.per_year.value if t.per_year else float("nan")
        shares = [word(v / level) if v == v and level == level else "–" for word, v in
                  ((percent, slope), (amount, t.day_sd), (amount, t.detectable))]  # fmt: skip
        rows.append(
            (
                f"{escape(name(s.parameter))}<small>{escape(s.parameter)}</small>",
                _STATES.get(t.state) or undetermined_state(t),
                _level(t),
                shares[0],
                shares[1] if t.day_sd else "–",
                shares[2],
                f"{int(np.sum(s.identifiable))} of {len(s.identifiable)}",
            )
        )
    return table_of_cells(head, rows)


def undated_rows(joint: str, history: Table) -> str:
    """Return the median and the range of each parameter over a joint's recordings, whose order is unknown."""
    head = ["Parameter", "#Median", "#Least", "#Most", "#Determined by"]
    of = np.asarray(history["joint"], str) == joint
    names = np.asarray(history["parameter"], str)
    rows = []
    for parameter in dict.fromkeys(n for n in names[of].tolist() if not n.startswith(CLOCKS)):
        at = np.flatnonzero(of & (names == parameter))
        values = np.asarray(history["value"], float)[at]
        sure = np.asarray(history["identifiable"], bool)[at] & np.isfinite(values)
        rows.append(
            (
                f"{escape(name(parameter))}<small>{escape(parameter)}</small>",
                *_median_and_ends(values[sure], str(history["unit"][at[0]])),
                f"{int(np.sum(sure))} of {len(at)}",
            )
        )
    return table_of_cells(head, rows)


def _median_and_ends(values: FloatArray, unit: str) -> list[str]:
    if not len(values):
        return ["–", "–", "–"]
    figures = (float(np.median(values)), float(np.min(values)), float(np.max(values)))
    factor, shown = (100.0, "%") if unit == "1" else words.unit_factor(figures[0], unit)
    return [escape(f"{words.number(v * factor, 4)} {shown}") for v in figures]


def _level(trend: Trend) -> str:
    """Return the level now; without a trend, the value of the latest recording that determines it."""
    s, unit = trend.series, trend.series.unit
    if trend.now is not None:
        return escape(value(trend.now, unit))
    if not np.any(s.identifiable):
        return "–"
    last = int(np.flatnonzero(s.identifiable)[-1])
    v, half = float(s.value[last]), float(Z95 * s.sd[last])
    return f"{escape(value(Interval(v, v - half, v + half), unit))}<small>latest recording</small>"


def undetermined_trends(fleet: FleetTrends) -> list[Trend]:
    """Return the trends of which nothing can be determined, or no more."""
    return [t for t in fleet.trends.values() if t.state == "undetermined" or math.isfinite(t.silent_since_s)]


def undetermined_table(undetermined: Sequence[Trend], links: Links) -> str:
    """Return the parameters without a trend, with reasons."""
    head = ["Joint", "Parameter", "State", "Why"]
    rows = [
        (links.joint(t.series.joint), escape(name(t.series.parameter)), _undetermined(t), escape(_why(t)))
        for t in undetermined
    ]
    return table_of_cells(head, rows)


def _undetermined(trend: Trend) -> str:
    return undetermined_state(trend) if trend.state == "undetermined" else "silent"


def _why(trend: Trend) -> str:
    if trend.state != "undetermined":
        return f"Determined until {day(trend.silent_since_s)}, but by no later recording"
    return words.sentence(trend.reason)


def _sure(confidence: float) -> str:
    return "> 99.99 %" if confidence > 0.9999 else f"{100.0 * confidence:.2f} %"
