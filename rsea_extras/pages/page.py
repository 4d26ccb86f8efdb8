"""The pages of a fleet: of the fleet, worst joints first, and of each joint, as files of one folder."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rsea_extras.pages import words as say
from rsea_extras.pages.joint_page import alarm_table, joint_page, joint_table, undetermined_table
from rsea_extras.pages.maps import heat_map, naming_map, timeline
from rsea_extras.trends.alarms import alarms_of, by_joint, worst_first
from rsea_extras.trends.fleet_trends import fleet_trends
from rsea_extras.trends.result import Alarm, FleetTrends, Steps, steps_over
from rsea_extras.trends.series import DEFAULT, Table, TrendSettings
from rsea_ros.extension.base import Destination, NewFiles, list_names
from rsea_ros.extension.page import Block, bullets, fold, key_numbers, page, section

INDEX = "index.html"
_ROWS = 60
"""Joints of a heat map: the first of a larger fleet."""


def write_fleet_report(
    history: Table, recordings: Table, out: Destination | Path | str, *, store: Path | str | None = None,
    settings: TrendSettings = DEFAULT,
) -> Path:  # fmt: skip
    """Write index.html and a page for each joint, and return the path of index.html.

    history, recordings: as of trends.fleet_trends. store: the folder that the paths in `artefacts` start
    from, `out` by default. Raises ParameterError for a table without its columns, OutputError for a name
    that is taken, OSError where something cannot be written.
    """
    fleet = fleet_trends(history, recordings, settings)
    alarms = alarms_of(fleet)
    steps, groups = steps_over(*(_period(recordings) or (0.0, 0.0))), by_joint(alarms)
    with NewFiles(out) as new:
        folder = new.folder if store is None else Path(store)
        links = say.Links(new.folder, folder, say.page_names(fleet.joints))
        for joint, name in links.pages.items():
            findings = groups.get(joint, [])
            new.write(name, joint_page(joint, fleet, findings, history, recordings, steps, links))
        return new.write(INDEX, fleet_page(fleet, alarms, recordings, steps, links))


def _period(recordings: Table) -> tuple[float, float] | None:
    """Return the times of the first and the last recording, POSIX s; None where none has a date."""
    time_s = np.asarray(recordings["time_s"], float)
    known = time_s[np.isfinite(time_s)]
    return (float(known.min()), float(known.max())) if known.size else None


def fleet_page(
    fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: say.Links
) -> str:
    """Return the page as HTML that opens without a network."""
    period = " to ".join(map(say.day, _period(recordings) or ())) or "no date"
    footer = [period, "rsea fleet report. All values in SI, all times UTC."]
    kicker = f"Fleet of {len(fleet.joints)} {say.plural(len(fleet.joints), 'joint')} · {period}"
    blocks = _blocks(fleet, alarms, recordings, steps, links)
    return page(_headline(fleet, alarms, recordings), kicker, blocks, footer)


def _blocks(
    fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table, steps: Steps, links: say.Links
) -> Iterator[Block]:
    groups, joints = by_joint(alarms), worst_first(fleet.joints, alarms)
    ranked = [a for group in groups.values() for a in group]
    silent = [
        t for t in fleet.trends.values() if t.state == "undetermined" or math.isfinite(t.silent_since_s)
    ]
    kinds = [a.kind for a in ranked]
    changes, causes = kinds.count("trend") + kinds.count("change"), [a for a in ranked if a.kind == "cause"]
    always = sum(a.from_first for a in causes)
    since = f", {always} from the first recording on" if always else " that appeared"
    done = np.asarray(recordings["outcome"], str) == "done"
    used, every = (f"{n:,}".replace(",", " ") for n in (np.sum(done), len(done)))
    latest = say.latest_causes(joints, recordings)
    look = len({*groups, *latest}) if _has_no_trend(fleet) else len(groups)
    yield key_numbers([
        (f"{look} of {len(fleet.joints)}", f"{say.plural(len(fleet.joints), 'joint')} to look at"),
        (str(changes), f"{say.plural(changes, 'change')}, {kinds.count('trend')} going on"),
        (str(len(causes)), f"{say.plural(len(causes), 'cause')}{since}"),
        (used, f"recordings used, of {every}"),
        (str(len(silent)), f"of {len(fleet.trends)} trends cannot be determined now"),
    ])  # fmt: skip
    yield from timeline(ranked, steps)
    if ranked:
        yield section("Worst joints first", alarm_table(ranked, links))
    for parameter in _parameters_with_map(fleet, joints[:_ROWS]):
        yield heat_map(parameter, joints[:_ROWS], fleet, steps)
    for kind, subject in dict.fromkeys((a.kind, a.about) for a in fleet.appearances):
        naming = {n.joint for n in fleet.namings if (n.kind, n.about) == (kind, subject)}
        yield naming_map(subject, kind, [j for j in joints if j in naming][:_ROWS], fleet, steps)
    yield section("All joints", joint_table(joints, fleet, groups, latest, recordings, links))
    number = "One trend" if len(silent) == 1 else f"{len(silent)} trends"
    if silent:
        yield section(f"{number} not determined", undetermined_table(silent, links))
    else:
        yield section("Nothing was left undetermined", "All recordings determine all parameters.")
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


def _has_no_trend(fleet: FleetTrends) -> bool:
    return all(t.state == "undetermined" for t in fleet.trends.values())


def _headline(fleet: FleetTrends, alarms: Sequence[Alarm], recordings: Table) -> str:
    if _has_no_trend(fleet):
        latest = say.latest_causes(fleet.joints, recordings)
        named = "".join(f"; the latest name {cause} in {joint}" for joint, cause in latest.items())
        if len(latest) > 1:
            named = f"; the latest of {len(latest)} joints name causes"
        return f"Too few recordings yet for trends{named}"
    groups = by_joint(alarms)
    if not groups:
        return f"All {len(fleet.joints)} joints are steady"
    first = next(iter(groups))
    number = f"{len(groups)} of {len(fleet.joints)} joints need" if len(groups) > 1 else "One joint needs"
    return f"{number} a look, {first} first: {say.about(groups[first][0])}"


def _sure(fleet: FleetTrends) -> list[str]:
    rate = f"{100.0 * fleet.false_discovery:g}"
    known = [(say.name(p), say.percent(m), s) for p, (m, s) in fleet.per_kelvin.items() if m]
    warm = [f"{name} {change} (± {200.0 * s:.2f} %)" for name, change, s in known]
    lines = [
        f"{fleet.tests} series were tested for any step or ramp, and every cause and fault for the day from "
        f"which on it is named. At most {rate} in 100 of the findings are expected to be false (Benjamini "
        "and Hochberg, over all joints and parameters of this look).",
        "Recordings of one day count as one draw: the effect of a day (mounting, grease, zeros) is "
        "estimated from the scatter of the days, by restricted likelihood, and is not a change.",
    ]
    if warm:
        lines.append(f"Change per kelvin, estimated across the joints of this fleet: {list_names(warm)}.")
    return lines
