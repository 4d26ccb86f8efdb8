"""The page of a joint: findings, each parameter over time, causes, recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from html import escape

import numpy as np

from rsea_ros.report.fleet.cause_figure import cause_figure, share_figure
from rsea_ros.report.fleet.latest import latest_causes
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.parameter_figure import parameter_figure
from rsea_ros.report.fleet.tables import alarm_table, parameter_rows, undated_rows
from rsea_ros.report.fleet.words import finding, name, sentence, short_day, undetermined_state
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import fold, key_numbers, paragraph, section
from rsea_ros.report.page.html_table import table_of_cells
from rsea_ros.report.words import sentence as capital
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.cause_series import Naming
from rsea_ros.trends.result import FleetTrends, Trend
from rsea_ros.trends.series import Table
from rsea_ros.trends.weeks import Steps

_LATEST = 100
"""Recordings that the page lists: the latest."""
_RARE = 0.02
"""Share of the recordings below which a cause or a fault has no figure, unless it appeared."""
_USUAL = 0.8
"""Share from which a cause's size is drawn as a parameter."""

_UNDATED = (
    "The stamps of these recordings count from the start of a machine. If their paths hold the date, state "
    "its form as “date” in joints.yaml (for example %Y-%m-%d). The table shows their values without an order."
)

_NO_PAGE = (
    "A recording links diagnosis.json where its run kept no page. To see one as a page: rsea diagnose BAG "
    '--rig RIG --out page. Paths: rsea fleet sql "SELECT recording, bag FROM recordings" --store STORE. '
    "rsea fleet run --pages keeps the pages of new recordings."
)


def joint_page(
    joint: str, fleet: FleetTrends, alarms: Sequence[Alarm], history: Table, recordings: Table, steps: Steps,
    links: Links,
) -> str:  # fmt: skip
    """Return the page as HTML that opens without a network. alarms: of this joint, the most urgent first."""
    rows = np.flatnonzero(np.asarray(recordings["joint"], str) == joint)
    latest = latest_causes([joint], recordings).get(joint, "")
    dated = _is_dated(recordings, rows)
    quiet = f"{latest} in its latest recording" if latest else _quiet(fleet, joint, dated)
    title = f"{joint}: {sentence(alarms[0]) if alarms else quiet}"
    blocks = list(_blocks(joint, fleet, alarms, history, recordings, rows, steps, links))
    footer = ["rsea fleet report. All values in SI, all times UTC."]
    return page(title, f"Joint {joint} · {len(rows)} recordings", blocks, footer)


def _blocks(
    joint: str, fleet: FleetTrends, alarms: Sequence[Alarm], history: Table, recordings: Table,
    rows: np.ndarray, steps: Steps, links: Links,
) -> Iterator[Block]:  # fmt: skip
    trends = [t for (j, _), t in fleet.trends.items() if j == joint]
    yield '<p class="next"><a href="index.html">All joints</a></p>'
    dated = _is_dated(recordings, rows)
    yield key_numbers(_keys(trends, recordings, rows, dated))
    if alarms:
        yield section("Findings", alarm_table(alarms, links, with_joint=False))
    yield from _pictures(joint, trends, fleet, steps)
    if not dated:
        values = undated_rows(joint, history)
        yield section("No recording has a date, so no trend can be estimated", paragraph(_UNDATED), values)
    if trends:
        yield section("All parameters", parameter_rows(trends))
    yield fold("The latest recordings" if dated else "Recordings", _recordings(recordings, rows, links))


def _pictures(joint: str, trends: Sequence[Trend], fleet: FleetTrends, steps: Steps) -> Iterator[Block]:
    """Yield the figures of changed parameters and new causes, then steady, usual and undetermined ones.

    A cause that nearly every recording names is shown as a parameter, or as a cause if its trend is unknown.
    """
    sized = [t for (j, p), t in fleet.sizes.items() if j == joint and _is_usual(p, joint, fleet)]
    moved = [t for t in (*trends, *sized) if t.state in ("trending", "changed")]
    yield from (parameter_figure(t, steps) for t in sorted(moved, key=lambda t: -_size(t)))
    known = {t.series.parameter.partition(".")[0] for t in sized if t.state != "undetermined"}
    yield from _namings(joint, fleet, steps, known, appeared=True)
    yield from (parameter_figure(t, steps) for t in (*trends, *sized) if t.state == "steady")
    yield from _namings(joint, fleet, steps, known, appeared=False)
    undetermined = [t for t in trends if t.state == "undetermined"]
    yield from _undetermined([t for t in undetermined if not np.isfinite(t.silent_since_s)])
    silent = [t for t in undetermined if np.isfinite(t.silent_since_s)]
    yield from (section(finding(t), paragraph(f"{capital(t.reason)}.")) for t in silent)


def _undetermined(trends: Sequence[Trend]) -> Iterator[Block]:
    """Yield a section for each reason why parameters have no trend."""
    groups: dict[tuple[str, str], list[str]] = {}
    for t in trends:
        groups.setdefault((undetermined_state(t), t.reason), []).append(name(t.series.parameter))
    for (state, reason), names in groups.items():
        title = f"{names[0] if len(names) == 1 else f'{len(names)} parameters'}: {state}"
        which = f"{'; '.join(names)}. " if len(names) > 1 else ""
        yield section(title, paragraph(f"{which}{capital(reason)}."))


def _size(trend: Trend) -> float:
    return abs(trend.relative) if trend.relative == trend.relative else 0.0


def _is_usual(parameter: str, joint: str, fleet: FleetTrends) -> bool:
    """Return whether nearly every recording names a cause, so that its size is a parameter like any other."""
    cause = parameter.partition(".")[0]
    return any(n.joint == joint and n.about == cause and np.mean(n.named) > _USUAL for n in fleet.namings)


def _namings(
    joint: str, fleet: FleetTrends, steps: Steps, known: Set[str], appeared: bool
) -> Iterator[Block]:
    """Yield the figures of causes and faults. known: causes that are shown as parameters."""
    appearances = {(a.joint, a.about, a.kind): a for a in fleet.appearances}
    for naming in sorted((n for n in fleet.namings if n.joint == joint), key=lambda n: n.kind):
        appearance = appearances.get((joint, naming.about, naming.kind))
        share = np.mean(naming.named)
        is_parameter = naming.about in known if naming.kind == "cause" else share > _USUAL
        is_shown = appearance is not None or (share >= _RARE and not (share > _USUAL and is_parameter))
        if (appearance is not None) != appeared or not is_shown:
            continue
        yield (
            cause_figure(naming, appearance, steps)
            if _has_size(naming)
            else share_figure(naming, appearance, steps)
        )


def _has_size(naming: Naming) -> bool:
    return naming.size is not None and bool(np.any(np.isfinite(naming.size)))


def _keys(trends: Sequence[Trend], recordings: Table, rows: np.ndarray, dated: bool) -> list[tuple[str, str]]:
    determined = sum(t.state != "undetermined" for t in trends)
    done = int(np.sum(np.asarray(recordings["outcome"], str)[rows] == "done"))
    faulty = sum(bool(len(recordings["faults"][i])) for i in rows if recordings["faults"][i] is not None)
    return [
        *([(f"{determined} of {len(trends)}", "parameters have a trend")] if dated else []),
        (str(done), f"recordings used, of {len(rows)}"),
        (str(faulty), "recordings with faults in the data"),
    ]


def _is_dated(recordings: Table, rows: np.ndarray) -> bool:
    return bool(np.any(np.isfinite(np.asarray(recordings["time_s"], float)[rows])))


def _quiet(fleet: FleetTrends, joint: str, dated: bool) -> str:
    if not dated:
        return "no recording has a date"
    trends = [t for (j, _), t in fleet.trends.items() if j == joint]
    determined = [t for t in trends if t.state != "undetermined"]
    return (
        f"steady in all {len(determined)} parameters that its recordings determine"
        if determined
        else "too few dated recordings yet"
    )


def _recordings(recordings: Table, rows: np.ndarray, links: Links) -> str:
    head = ["Recording", "Date", "Outcome", "Verdict", "Causes", "Faults"]
    time_s = np.asarray(recordings["time_s"], float)
    latest = rows[np.argsort(-np.nan_to_num(time_s[rows]), kind="stable")][:_LATEST]
    body = [
        (
            links.recording(str(recordings["recording"][i]), str(recordings["artefacts"][i])),
            short_day(time_s[i]) if np.isfinite(time_s[i]) else "unknown",
            escape(str(recordings["outcome"][i])),
            escape(str(recordings["verdict"][i]).replace("_", " ")),
            escape(_names(recordings["causes"][i], "name")) or "–",
            escape(_names(recordings["faults"][i], "kind")) or "–",
        )
        for i in latest
    ]
    artefacts = [str(recordings["artefacts"][i]) for i in latest]
    hint = paragraph(_NO_PAGE) if any(map(links.lacks_page, artefacts)) else ""
    return hint + table_of_cells(head, body)


def _names(items: object, key: str) -> str:
    listed = items if isinstance(items, (list, tuple, np.ndarray)) else []
    return ", ".join(str(i[key] if isinstance(i, dict) else i).replace("_", " ") for i in listed)
