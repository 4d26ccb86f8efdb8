"""The page of a fleet: worst joints first, what changed since when, joints × weeks, what cannot be told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rsea_ros.report.fleet.fleet_tables import alarm_table, joint_table, untold_table, untold_trends
from rsea_ros.report.fleet.fleet_words import about, day, name, percent
from rsea_ros.report.fleet.heat_map import heat_map, naming_map, shades
from rsea_ros.report.fleet.links import Links
from rsea_ros.report.fleet.timeline import timeline
from rsea_ros.report.page import Block, bullets, folded, key_numbers, page, paragraph, section
from rsea_ros.trends.alarms import Alarm
from rsea_ros.trends.ranking import by_joint, worst_first
from rsea_ros.trends.result import FleetTrends
from rsea_ros.trends.series import Table
from rsea_ros.trends.weeks import Steps
from rsea_ros.wording import listed

_ROWS = 60
"""Joints of a heat map: the first of a larger fleet."""


def fleet_page(
    found: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: Links
) -> str:
    """Return the page as HTML that opens without a network."""
    blocks = list(_blocks(found, alarms, recordings, steps, links))
    footer = [_period(recordings), "rsea fleet report. All values in SI, all times UTC."]
    kicker = f"Fleet of {len(found.joints)} joints · {_period(recordings)}"
    return page(_headline(found, alarms), kicker, blocks, footer)


def _blocks(
    found: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: Links
) -> Iterator[Block]:
    groups = by_joint(alarms)
    ranked = [a for group in groups.values() for a in group]
    joints = worst_first(found.joints, alarms)
    yield key_numbers(_keys(found, groups, recordings))
    yield f"<style>{(Path(__file__).parent / 'fleet.css').read_text(encoding='utf-8')}{shades()}</style>"
    yield timeline(ranked, steps, links)
    if ranked:
        yield section("Worst joints first", alarm_table(ranked, links))
    for parameter in _mapped(found):
        yield heat_map(parameter, joints[:_ROWS], found, steps, links)
    for kind, what in dict.fromkeys((a.kind, a.about) for a in found.appearances):
        yield naming_map(what, kind, _naming(found, kind, what, joints)[:_ROWS], found, steps, links)
    yield section("All joints", joint_table(joints, found, groups, recordings, links))
    yield _untold(found, links)
    yield folded("How sure this is", bullets(_sure(found)))


def _mapped(found: FleetTrends) -> list[str]:
    """Return the parameters that have a map, those that moved most first; of causes the usual ones."""
    sized = [p for _, p in found.sizes]
    usual = [p for p in dict.fromkeys(sized) if 2 * sized.count(p) > len(found.joints)]
    courses = {**found.trends, **found.sizes}

    def moved(parameter: str) -> float:
        here = [t for (_, p), t in courses.items() if p == parameter and t.changes]
        return -max((abs(t.relative) for t in here), default=0.0)

    return sorted([*dict.fromkeys(p for _, p in found.trends), *usual], key=moved)


def _headline(found: FleetTrends, alarms: Sequence[Alarm]) -> str:
    if not any(t.state != "untold" for t in found.trends.values()):
        return "These recordings are too few to say how the joints fare"
    groups = by_joint(alarms)
    if not groups:
        return f"All {len(found.joints)} joints are steady"
    first = next(iter(groups))
    number = f"{len(groups)} of {len(found.joints)} joints need" if len(groups) > 1 else "One joint needs"
    return f"{number} a look, {first} first: {about(groups[first][0])}"


def _keys(found: FleetTrends, groups: dict[str, list[Alarm]], recordings: Table) -> list[tuple[str, str]]:
    kinds = [a.kind for group in groups.values() for a in group]
    done = int(np.sum(np.asarray(recordings["outcome"], str) == "done"))
    return [
        (f"{len(groups)} of {len(found.joints)}", "joints need a look"),
        (str(kinds.count("trend") + kinds.count("change")), f"changes, {kinds.count('trend')} going on"),
        (str(kinds.count("cause")), "causes that appeared"),
        (_grouped(done), f"recordings used, of {_grouped(len(recordings['joint']))}"),
        (str(len(untold_trends(found))), f"of {len(found.trends)} courses cannot be told, or no more"),
    ]


def _grouped(number: int) -> str:
    """Return a number with its thousands apart."""
    return f"{number:,}".replace(",", " ")


def _naming(found: FleetTrends, kind: str, what: str, joints: Sequence[str]) -> list[str]:
    naming = {n.joint for n in found.namings if (n.kind, n.about) == (kind, what)}
    return [j for j in joints if j in naming]


def _untold(found: FleetTrends, links: Links) -> str:
    untold = untold_trends(found)
    if not untold:
        return section("Nothing was left untold", paragraph("Every joint's recordings tell every parameter."))
    number = "One course" if len(untold) == 1 else f"{len(untold)} courses"
    title = f"{number} cannot be told: not enough excitation"
    return section(title, untold_table(untold, links))


def _sure(found: FleetTrends) -> list[str]:
    rate = f"{100.0 * found.false_discovery:g}"
    warm = [f"{name(p)} {percent(m)} (± {200.0 * s:.2f} %)" for p, (m, s) in found.per_kelvin.items() if m]
    lines = [
        f"{found.tests} courses were tested for any step or ramp, and every cause and fault for the day from "
        f"which on it is named. At most {rate} in 100 of the findings are expected to be false (Benjamini "
        f"and Hochberg, over all joints and parameters of this look).",
        "Recordings of one day count as one draw: what a day does to a joint (mounting, grease, zeros) is "
        "estimated from the scatter of the days, by restricted likelihood, and is no change.",
    ]
    if warm:
        lines.append(f"A kelvin changes, as the joints of this fleet tell each other: {listed(warm)}.")
    return lines


def _period(recordings: Table) -> str:
    time_s = np.asarray(recordings["time_s"], float)
    known = time_s[np.isfinite(time_s)]
    return f"{day(known.min())} to {day(known.max())}" if known.size else "no date"
