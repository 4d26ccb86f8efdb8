"""The page of a joint: findings, each parameter over time, causes, recordings."""

from collections.abc import Iterator, Sequence, Set

import numpy as np

from rsea_ros.report.fleet import words as say
from rsea_ros.report.fleet.figures import naming_figure, parameter_figure
from rsea_ros.report.fleet.tables import alarm_table, parameter_rows, recording_table, trends_of, undated_rows
from rsea_ros.report.page import Block, Html, fold, key_numbers, page, section
from rsea_ros.report.words import sentence as capital
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.result import FleetTrends, Trend
from rsea_ros.trends.series import Table
from rsea_ros.trends.weeks import Steps

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

    def blocks() -> Iterator[Block]:
        trends = trends_of(joint, fleet)
        yield Html('<p class="next"><a href="index.html">All joints</a></p>')
        outcome = np.asarray(recordings["outcome"], str)[rows]
        faulty = sum(bool(len(recordings["faults"][i])) for i in rows if recordings["faults"][i] is not None)
        yield key_numbers([
            *([(f"{determined} of {len(trends)}", "parameters have a trend")] if dated else []),
            (str(int(np.sum(outcome == "done"))), f"recordings used, of {len(rows)}"),
            (str(faulty), "recordings with faults in the data"),
        ])  # fmt: skip
        if alarms:
            yield section("Findings", alarm_table(alarms, links, with_joint=False))
        yield from _pictures(joint, trends, fleet, steps)
        if not dated:
            undated = "No recording has a date, so no trend can be estimated"
            yield section(undated, _UNDATED, undated_rows(joint, history))
        if trends:
            yield section("All parameters", parameter_rows(trends))
        yield fold(
            "The latest recordings" if dated else "Recordings", recording_table(recordings, rows, links)
        )

    footer = ["rsea fleet report. All values in SI, all times UTC."]
    return page(f"{joint}: {title}", f"Joint {joint} · {len(rows)} recordings", blocks(), footer)


def _pictures(joint: str, trends: Sequence[Trend], fleet: FleetTrends, steps: Steps) -> Iterator[Block]:
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
    undetermined = [t for t in trends if t.state == "undetermined"]
    groups: dict[tuple[str, str], list[str]] = {}  # by the reason why they have no trend
    for t in undetermined:
        if not np.isfinite(t.silent_since_s):
            groups.setdefault((say.undetermined_state(t), t.reason), []).append(say.name(t.series.parameter))
    for (state, reason), names in groups.items():
        title = f"{names[0] if len(names) == 1 else f'{len(names)} parameters'}: {state}"
        which = f"{'; '.join(names)}. " if len(names) > 1 else ""
        yield section(title, f"{which}{capital(reason)}.")
    silent = (t for t in undetermined if np.isfinite(t.silent_since_s))
    yield from (section(say.finding(t), f"{capital(t.reason)}.") for t in silent)


def _namings(
    joint: str, fleet: FleetTrends, steps: Steps, known: Set[str], appeared: bool
) -> Iterator[Block]:
    """Yield the figures of causes and faults. known: causes that are shown as parameters."""
    appearances = {(a.joint, a.about, a.kind): a for a in fleet.appearances}
    for naming in sorted((n for n in fleet.namings if n.joint == joint), key=lambda n: n.kind):
        appearance, share = appearances.get((joint, naming.about, naming.kind)), np.mean(naming.named)
        is_parameter = naming.about in known if naming.kind == "cause" else share > _USUAL
        is_shown = appearance is not None or (share >= _RARE and not (share > _USUAL and is_parameter))
        if (appearance is not None) == appeared and is_shown:
            yield naming_figure(naming, appearance, steps)
