"""The page of a fleet: worst joints first, dated changes, joints × weeks, undetermined parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rsea_ros.documents.wording import list_names
from rsea_ros.report.fleet.heat_map import heat_map, naming_map, shades
from rsea_ros.report.fleet.latest import latest_causes
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.tables import (
    alarm_table,
    joint_table,
    undetermined_table,
    undetermined_trends,
)
from rsea_ros.report.fleet.timeline import timeline
from rsea_ros.report.fleet.words import about, day, name, percent
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, fold, key_numbers, paragraph, section
from rsea_ros.trends.alarms import Alarm, by_joint, worst_first
from rsea_ros.trends.result import FleetTrends
from rsea_ros.trends.series import Table
from rsea_ros.trends.weeks import Steps

_ROWS = 60
"""Joints of a heat map: the first of a larger fleet."""


def fleet_page(
    fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: Links
) -> str:
    """Return the page as HTML that opens without a network."""
    blocks = list(_blocks(fleet, alarms, recordings, steps, links))
    footer = [_period(recordings), "rsea fleet report. All values in SI, all times UTC."]
    kicker = f"Fleet of {len(fleet.joints)} joints · {_period(recordings)}"
    return page(_headline(fleet, alarms, recordings), kicker, blocks, footer)


def _blocks(
    fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: Links
) -> Iterator[Block]:
    groups = by_joint(alarms)
    ranked = [a for group in groups.values() for a in group]
    joints = worst_first(fleet.joints, alarms)
    latest = latest_causes(joints, recordings)
    yield key_numbers(_keys(fleet, groups, recordings))
    yield f"<style>{(Path(__file__).parent / 'fleet.css').read_text(encoding='utf-8')}{shades()}</style>"
    yield timeline(ranked, steps, links)
    if ranked:
        yield section("Worst joints first", alarm_table(ranked, links))
    for parameter in _parameters_with_map(fleet, joints[:_ROWS]):
        yield heat_map(parameter, joints[:_ROWS], fleet, steps, links)
    for kind, subject in dict.fromkeys((a.kind, a.about) for a in fleet.appearances):
        yield naming_map(
            subject, kind, _name_lines(fleet, kind, subject, joints)[:_ROWS], fleet, steps, links
        )
    yield section("All joints", joint_table(joints, fleet, groups, latest, recordings, links))
    yield _undetermined_text(fleet, links)
    yield fold("Certainty of these findings", bullets(_sure(fleet)))


def _parameters_with_map(fleet: FleetTrends, shown: Sequence[str]) -> list[str]:
    """Return the parameters that have a map, those that moved most first; of causes the usual ones.

    A parameter without a trend in any joint shown has none: the table of the undetermined ones says why.
    """
    sized = [p for _, p in fleet.sizes]
    usual = [p for p in dict.fromkeys(sized) if 2 * sized.count(p) > len(fleet.joints)]
    trends = {**fleet.trends, **fleet.sizes}

    def movement(parameter: str) -> float:
        changed = [t for (_, p), t in trends.items() if p == parameter and t.changes]
        return -max((abs(t.relative) for t in changed), default=0.0)

    with_trend = {p for (joint, p), t in trends.items() if joint in shown and t.state != "undetermined"}
    every = dict.fromkeys([*(p for _, p in fleet.trends), *usual])
    return sorted((p for p in every if p in with_trend), key=movement)


def _headline(fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table) -> str:
    if not any(t.state != "undetermined" for t in fleet.trends.values()):
        return f"Too few recordings yet for trends{_latest(fleet, recordings)}"
    groups = by_joint(alarms)
    if not groups:
        return f"All {len(fleet.joints)} joints are steady"
    first = next(iter(groups))
    number = f"{len(groups)} of {len(fleet.joints)} joints need" if len(groups) > 1 else "One joint needs"
    return f"{number} a look, {first} first: {about(groups[first][0])}"


def _latest(fleet: FleetTrends, recordings: Table) -> str:
    """Return what the latest recordings name: the causes of one joint, or the number of joints."""
    latest = latest_causes(fleet.joints, recordings)
    if len(latest) > 1:
        return f"; the latest of {len(latest)} joints name causes"
    return "".join(f"; the latest name {cause} in {joint}" for joint, cause in latest.items())


def _keys(fleet: FleetTrends, groups: dict[str, list[Alarm]], recordings: Table) -> list[tuple[str, str]]:
    kinds = [a.kind for group in groups.values() for a in group]
    changes = kinds.count("trend") + kinds.count("change")
    done = int(np.sum(np.asarray(recordings["outcome"], str) == "done"))
    return [
        (f"{len(groups)} of {len(fleet.joints)}", "joints need a look"),
        (str(changes), f"{_plural(changes, 'change')}, {kinds.count('trend')} going on"),
        (str(kinds.count("cause")), _causes_word([a for group in groups.values() for a in group])),
        (_group_digits(done), f"recordings used, of {_group_digits(len(recordings['joint']))}"),
        (
            str(len(undetermined_trends(fleet))),
            f"of {len(fleet.trends)} trends not determined, or no more",
        ),
    ]


def _causes_word(alarms: Sequence[Alarm]) -> str:
    causes = [a for a in alarms if a.kind == "cause"]
    always = sum(a.from_first for a in causes)
    word = _plural(len(causes), "cause")
    return f"{word}, {always} from the first recording on" if always else f"{word} that appeared"


def _plural(number: int, word: str) -> str:
    return word if number == 1 else f"{word}s"


def _group_digits(number: int) -> str:
    """Return a number with its thousands apart."""
    return f"{number:,}".replace(",", " ")


def _name_lines(fleet: FleetTrends, kind: str, subject: str, joints: Sequence[str]) -> list[str]:
    naming = {n.joint for n in fleet.namings if (n.kind, n.about) == (kind, subject)}
    return [j for j in joints if j in naming]


def _undetermined_text(fleet: FleetTrends, links: Links) -> str:
    undetermined = undetermined_trends(fleet)
    if not undetermined:
        return section("Nothing was left undetermined", paragraph("All recordings determine all parameters."))
    number = "One trend" if len(undetermined) == 1 else f"{len(undetermined)} trends"
    title = f"{number} not determined"
    return section(title, undetermined_table(undetermined, links))


def _sure(fleet: FleetTrends) -> list[str]:
    rate = f"{100.0 * fleet.false_discovery:g}"
    warm = [f"{name(p)} {percent(m)} (± {200.0 * s:.2f} %)" for p, (m, s) in fleet.per_kelvin.items() if m]
    lines = [
        f"{fleet.tests} series were tested for any step or ramp, and every cause and fault for the day from "
        f"which on it is named. At most {rate} in 100 of the findings are expected to be false (Benjamini "
        f"and Hochberg, over all joints and parameters of this look).",
        "Recordings of one day count as one draw: the effect of a day (mounting, grease, zeros) is "
        "estimated from the scatter of the days, by restricted likelihood, and is not a change.",
    ]
    if warm:
        lines.append(f"Change per kelvin, estimated across the joints of this fleet: {list_names(warm)}.")
    return lines


def _period(recordings: Table) -> str:
    time_s = np.asarray(recordings["time_s"], float)
    known = time_s[np.isfinite(time_s)]
    return f"{day(known.min())} to {day(known.max())}" if known.size else "no date"
