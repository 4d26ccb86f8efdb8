"""The page of a joint: findings, each parameter over time, causes, recordings; and the tables of a fleet."""

import math
from collections.abc import Iterator, Mapping, Sequence, Set

import numpy as np

from rsea_extras.pages import words as say
from rsea_extras.pages.figures import determined_by, naming_figure, parameter_figure
from rsea_extras.pages.words import Links
from rsea_extras.trends.result import Alarm, FleetTrends, Interval, Steps, Trend
from rsea_extras.trends.series import CLOCKS, Table
from rsea_ros.extension.base import Z95
from rsea_ros.extension.page import html, words

_RARE = 0.02
"""Share of the recordings below which a cause or a fault has no figure, unless it appeared."""
_USUAL = 0.8
"""Share from which a cause's size is drawn as a parameter."""
_UNDATED = (
    "The stamps of these recordings count from the start of a machine. If their paths hold the date, state "
    "its form as “date” in joints.yaml (for example %Y-%m-%d). The table shows their values without an order."
)


def joint_page(
    joint: str, fleet: FleetTrends, alarms: Sequence[Alarm], history: Table, recordings: Table, steps: Steps,
    links: say.Links,
) -> str:  # fmt: skip
    """Return the page as HTML that opens without a network. alarms: of this joint, the most urgent first."""
    rows = np.flatnonzero(np.asarray(recordings["joint"], str) == joint)
    dated = bool(np.any(np.isfinite(np.asarray(recordings["time_s"], float)[rows])))
    determined = sum(t.state != "undetermined" for t in trends_of(joint, fleet))
    if alarms:
        title = say.sentence(alarms[0])
    elif latest := say.latest_causes([joint], recordings).get(joint, ""):
        title = f"{latest} in its latest recording"
    elif not dated:
        title = "no recording has a date"
    elif determined:
        title = f"steady in all {determined} parameters that its recordings determine"
    else:
        title = "too few dated recordings yet"

    def blocks() -> Iterator[html.Block]:
        trends = trends_of(joint, fleet)
        yield html.Html('<p class="next"><a href="index.html">All joints</a></p>')
        outcome = np.asarray(recordings["outcome"], str)[rows]
        faulty = sum(bool(len(recordings["faults"][i])) for i in rows)
        yield html.key_numbers([
            *([(f"{determined} of {len(trends)}", "parameters have a trend")] if dated else []),
            (str(int(np.sum(outcome == "done"))), f"recordings used, of {len(rows)}"),
            (str(faulty), f"{say.plural(faulty, 'recording')} with faults in the data"),
        ])  # fmt: skip
        if alarms:
            yield html.section("Findings", alarm_table(alarms, links, with_joint=False))
        yield from _pictures(joint, trends, fleet, steps)
        if not dated:
            undated = "No recording has a date, so no trend can be estimated"
            yield html.section(undated, _UNDATED, undated_rows(joint, history))
        if trends:
            yield html.section("All parameters", parameter_rows(trends))
        yield html.fold(
            "The latest recordings" if dated else "Recordings", recording_table(recordings, rows, links)
        )

    footer = ["rsea fleet report. All values in SI, all times UTC."]
    kicker = f"Joint {joint} · {len(rows)} {say.plural(len(rows), 'recording')}"
    return html.page(f"{joint}: {title}", kicker, blocks(), footer)


def _pictures(joint: str, trends: Sequence[Trend], fleet: FleetTrends, steps: Steps) -> Iterator[html.Block]:
    """Yield the figures of changed parameters and new causes, then steady, usual and undetermined ones.

    A cause that nearly every recording names is shown as a parameter, or as a cause if its trend is unknown.
    """
    usual = {n.about for n in fleet.namings if n.joint == joint and np.mean(n.named) > _USUAL}
    sized = [t for (j, p), t in fleet.sizes.items() if j == joint and p.partition(".")[0] in usual]
    moved = [t for t in (*trends, *sized) if t.state in ("trending", "changed")]
    moved.sort(key=lambda t: -np.nan_to_num(abs(t.relative), posinf=np.inf))
    yield from (parameter_figure(t, steps) for t in moved)
    known = {t.series.parameter.partition(".")[0] for t in sized if t.state != "undetermined"}
    yield from _namings(joint, fleet, steps, known, appeared=True)
    yield from (parameter_figure(t, steps) for t in (*trends, *sized) if t.state == "steady")
    yield from _namings(joint, fleet, steps, known, appeared=False)
    if undetermined := [t for t in trends if t.state == "undetermined"]:
        yield html.section("What these recordings cannot determine", undetermined_table(undetermined))


def _namings(
    joint: str, fleet: FleetTrends, steps: Steps, known: Set[str], appeared: bool
) -> Iterator[html.Block]:
    """Yield the figures of causes and faults. known: causes that are shown as parameters."""
    appearances = {(a.joint, a.about, a.kind): a for a in fleet.appearances}
    for naming in sorted((n for n in fleet.namings if n.joint == joint), key=lambda n: n.kind):
        appearance, share = appearances.get((joint, naming.about, naming.kind)), np.mean(naming.named)
        is_parameter = naming.about in known if naming.kind == "cause" else share > _USUAL
        is_shown = appearance is not None or (share >= _RARE and not (share > _USUAL and is_parameter))
        if (appearance is not None) == appeared and is_shown:
            yield naming_figure(naming, appearance, steps)


_LATEST = 100
"""Recordings that a page lists: the latest."""
_NO_PAGE = (
    "A recording links diagnosis.json where its run kept no page. To see one as a page: rsea diagnose BAG "
    '--rig RIG --out page. Paths: rsea fleet sql "SELECT recording, bag FROM recordings" --store STORE. '
    "rsea fleet run --pages keeps the pages of new recordings."
)


def alarm_table(alarms: Sequence[Alarm], links: Links, with_joint: bool = True) -> html.Html:
    """Return the findings with date, size, how sure, and the recording that shows each first."""

    def sure(a: Alarm) -> str:
        return "> 99.99 %" if a.confidence > 0.9999 else f"{100.0 * a.confidence:.2f} %"

    return html.listed(
        alarms,
        *([("Joint", lambda a: links.joint(a.joint))] if with_joint else []),
        ("Finding", say.sentence),
        ("Began", lambda a: say.doubt_of_date(a) or "–"),
        ("#Size, 95 %", lambda a: say.value(a.size, a.unit) if a.size is not None else "–"),
        ("#Sure", sure),
        ("Shown first by", lambda a: links.recording(a.recording, a.artefacts) if a.recording else "–"),
    )


def joint_table(
    joints: Sequence[str], fleet: FleetTrends, alarmed: Mapping[str, Sequence[Alarm]],
    latest: Mapping[str, str], recordings: Table, links: Links,
) -> html.Html:  # fmt: skip
    """Return a row for each joint. latest: causes that its latest recording names."""
    of, done = np.asarray(recordings["joint"], str), np.asarray(recordings["outcome"], str) == "done"
    dated = np.isfinite(np.asarray(recordings["time_s"], float))
    rows = []
    for joint in joints:
        trends, own = trends_of(joint, fleet), of == joint
        determined = [t for t in trends if t.state != "undetermined"]
        moved = max((t.relative for t in determined if t.changes), key=abs, default=float("nan"))
        state = ", ".join(dict.fromkeys(a.kind for a in alarmed.get(joint, ())))
        if not state:
            known = "steady" if determined else "too few dated recordings"
            state = f"now {latest[joint]}" if latest.get(joint) else known
        rows.append((
            links.joint(joint), state if np.any(dated & own) else "no recording has a date",
            str(int(np.sum(own))), str(int(np.sum(own & ~done))),
            f"{len(determined)} of {len(trends)}", say.percent(moved) if moved == moved else "–",
        ))  # fmt: skip
    numbers = ("#Recordings", "#Refused or broken", "#Parameters with a trend", "#Largest change")
    return html.table(["Joint", "State", *numbers], rows)


def trends_of(joint: str, fleet: FleetTrends) -> list[Trend]:
    """Return the trends of the parameters of a joint."""
    return [t for (j, _), t in fleet.trends.items() if j == joint]


def parameter_rows(trends: Sequence[Trend]) -> html.Html:
    """Return a row for each parameter of a joint: level, slope, scatter, least detectable step."""

    def share(t: Trend, of: float) -> float:
        return of / abs(t.now.value) if t.now is not None and t.now.value else math.nan

    def slope(t: Trend) -> str:
        a_year = share(t, t.per_year.value) if t.per_year else math.nan
        return "–" if math.isnan(a_year) else say.percent(a_year)

    def size(t: Trend, of: float) -> str:
        return "–" if math.isnan(share(t, of)) else say.amount(share(t, of))

    def state(t: Trend) -> str:
        states = {"trending": "going on", "undetermined": say.undetermined_state(t)}
        return states.get(t.state, t.state)

    return html.listed(
        trends,
        ("Parameter", lambda t: html.named(say.name(t.series.parameter), t.series.parameter)),
        ("State", state),
        ("#Now, 95 %", _level),
        ("#A year", slope),
        ("#Scatter of days", lambda t: size(t, t.day_sd) if t.day_sd else "–"),
        ("#Smallest detectable step", lambda t: size(t, t.detectable)),
        ("#Determined by", determined_by),
    )


def _level(trend: Trend) -> str:
    """Return the level now; without a trend, the value of the latest recording that determines it."""
    s = trend.series
    if trend.now is not None:
        return say.value(trend.now, s.unit)
    if not np.any(s.identifiable):
        return "–"
    last = int(np.flatnonzero(s.identifiable)[-1])
    v, half = float(s.value[last]), float(Z95 * s.sd[last])
    return html.named(say.value(Interval(v, v - half, v + half), s.unit), "latest recording")


def undated_rows(joint: str, history: Table) -> html.Html:
    """Return the median and the range of each parameter over a joint's recordings, whose order is unknown."""
    of, names = np.asarray(history["joint"], str) == joint, np.asarray(history["parameter"], str)
    rows = []
    for parameter in dict.fromkeys(n for n in names[of].tolist() if not n.startswith(CLOCKS)):
        at = np.flatnonzero(of & (names == parameter))
        values, unit = np.asarray(history["value"], float)[at], str(history["unit"][at[0]])
        sure = np.asarray(history["identifiable"], bool)[at] & np.isfinite(values)
        shown = ["–", "–", "–"]
        if np.any(sure):
            figures = [float(of_sure(values[sure])) for of_sure in (np.median, np.min, np.max)]
            factor, unit = (100.0, "%") if unit == "1" else words.unit_factor(figures[0], unit)
            shown = [f"{words.number(v * factor, 4)} {unit}" for v in figures]
        rows.append((html.named(say.name(parameter), parameter), *shown, f"{int(np.sum(sure))} of {len(at)}"))
    return html.table(["Parameter", "#Median", "#Least", "#Most", "#Determined by"], rows)


def undetermined_table(undetermined: Sequence[Trend], links: Links | None = None) -> html.Html:
    """Return the parameters without a trend, or of which no later recording says anything, with reasons.

    links: to the joints, where there are several.
    """

    def why(t: Trend) -> str:
        last = t.silent_since_s
        silent = f"Determined until {say.day(last)}, but by no later recording" if math.isfinite(last) else ""
        return ". ".join(filter(None, (words.sentence(t.reason), silent)))

    return html.listed(
        undetermined,
        *([("Joint", lambda t: links.joint(t.series.joint))] if links else []),
        ("Parameter", lambda t: say.name(t.series.parameter)),
        ("State", lambda t: say.undetermined_state(t) if t.state == "undetermined" else "silent"),
        ("Why", why),
    )


def recording_table(recordings: Table, rows: np.ndarray, links: Links) -> html.Html:
    """Return the latest recordings of a joint. rows: its recordings."""
    time_s = np.asarray(recordings["time_s"], float)
    latest = rows[np.argsort(-np.nan_to_num(time_s[rows]), kind="stable")][:_LATEST]

    def text(column: str, i: int) -> str:
        return str(recordings[column][i])

    def names(column: str, key: str, i: int) -> str:
        return ", ".join(str(x[key]).replace("_", " ") for x in recordings[column][i]) or "–"

    lacking = any(links.lacks_page(text("artefacts", i)) for i in latest)
    return html.Html(html.paragraph(_NO_PAGE if lacking else "") + html.listed(
        latest,
        ("Recording", lambda i: links.recording(text("recording", i), text("artefacts", i))),
        ("Date", lambda i: say.day(time_s[i], short=True) if np.isfinite(time_s[i]) else "unknown"),
        ("Outcome", lambda i: text("outcome", i)),
        ("Verdict", lambda i: text("verdict", i).replace("_", " ")),
        ("Causes", lambda i: names("causes", "name", i)),
        ("Faults", lambda i: names("faults", "kind", i)),
    ))  # fmt: skip
