"""Ten simulated fleets over a year through trends and alarms of `rsea fleet`: required and measured values.

python -m bench fleet trends --log /tmp/fleets.jsonl [--seeds 10] [--seconds 200]

A fleet: 20 joints, 500 recordings each, a season of temperature, a day effect, normal work. Five wear, one is
replaced, three get faults of the data. Every week of the year `alarms` looks at the recordings so
far, as `rsea fleet watch` does. The results of a recording are drawn from a played sample
(trends_played.py), because diagnosing 100 000 recordings would take a week. The log goes on
where it stopped.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench import parser_of
from bench.fleet.simulated import DAY, DAY_SD, START, Fleet, Wear, fleet
from bench.results import append_line, read_lines
from rsea_ros.trends import Alarm, TrendSettings, alarms
from rsea_ros.trends.alarms import by_joint
from rsea_ros.trends.appearing import scan_threshold

WEEK, FIRST = 7, 28
"""Days between looks; the first look."""
RIGHT = {
    "stiffness": ("spring.stiffness",),
    "friction": ("rotor.reflected_damping", "coulomb_friction.torque"),
    "gap": ("backlash",),
    "delay": ("command_delay",),
    "ft_gain": ("ft_gain_error",),
}
"""Right subjects of an alarm, by kind of wear. A replaced joint may differ in anything."""


def look(made: Fleet, day: float) -> tuple[Alarm, ...]:
    """Return the alarms on the recordings of a fleet until a day."""
    parts = []
    for table in (made.history, made.recordings):
        until = table["time_s"] < START + DAY * day
        parts.append({n: c[until] for n, c in table.items()})
    return alarms(*parts)


def outcome(seed: int, values: str) -> dict[str, Any]:
    """Return the outcome of the fleet of a seed."""
    begun = time.perf_counter()
    made = fleet(seed, values=values)
    first: dict[str, tuple[float, Alarm]] = {}
    last: tuple[Alarm, ...] = ()
    days = [*range(FIRST, 365, WEEK), 365]
    for day in days:
        last = look(made, day)
        for alarm in last:
            first.setdefault(alarm.key, (float(day), alarm))
    false = [a.key for d, a in first.values() if is_false(made.wear.get(a.joint), d, a)]
    beside = [a.key for d, a in first.values() if is_beside(made.wear.get(a.joint), d, a)]
    groups = by_joint(last)
    worn = [judge_joint(made, joint, wear, groups.get(joint, []), first) for joint, wear in made.wear.items()]
    return {
        "seed": seed, "worn": worn, "false": false, "beside": beside,
        "joint_days": 20 * 365, "looks": len(days),
        "seconds": round(time.perf_counter() - begun, 1),
    }  # fmt: skip


def is_false(wear: Wear | None, day: float, alarm: Alarm) -> bool:
    """Return whether nothing had happened to the joint when it was alarmed, or only to its data."""
    if wear is None or day < wear.since:
        return True
    return wear.kind == "fault" and alarm.about != wear.fault


def is_beside(wear: Wear | None, day: float, alarm: Alarm) -> bool:
    """Return whether an alarm of a worn joint is not about what wore: a consequence, or a wrong name."""
    if wear is None or wear.kind in ("replaced", "fault") or day < wear.since:
        return False
    return alarm.about not in RIGHT[wear.kind]


def judge_joint(
    made: Fleet, joint: str, wear: Wear, final: Sequence[Alarm], first: dict[str, tuple[float, Alarm]]
) -> dict[str, Any]:
    """Return whether the joint's first finding is right, its date's error, and the delay beside its limit."""
    names = RIGHT.get(wear.kind, (wear.fault,) if wear.fault else ())
    right = [a for a in final if a.about in names or not names]
    seen = [
        d
        for d, a in first.values()
        if a.joint == joint and (a.about in names or not names) and d >= wear.since
    ]
    dates = [(a.since_s - START) / DAY - wear.since for a in right if np.isfinite(a.since_s)]
    return {
        "joint": joint,
        "kind": wear.kind,
        "ramp": wear.ramp,
        "right": bool(right) and (not names or final[0].about in names),
        "named": final[0].about if final else "",
        "date_error": float(min(dates, key=abs)) if dates else None,
        "first_date_error": float(dates[0]) if dates else None,
        "delay": float(min(seen) - wear.since) if seen else None,
        "limit": limit(made, joint, wear),
    }


def limit(made: Fleet, joint: str, wear: Wear) -> float | None:
    """Return days after the onset from which an observer who knows the shape could be sure, by the intervals.

    Of a parameter: its expected score, from the recordings' intervals and the true day effect, passes
    the threshold of the alarms. Of a cause or a fault: the third day that names it.
    """
    settings = TrendSettings()
    if wear.kind in ("stiffness", "friction"):
        about = {"stiffness": "spring.stiffness", "friction": "rotor.reflected_damping"}[wear.kind]
        return _limit_of_parameter(made, joint, wear, about)
    if wear.kind == "replaced":
        return None
    name = RIGHT[wear.kind][0] if wear.kind in RIGHT else wear.fault
    column = "faults" if wear.fault else "causes"
    r = made.recordings
    named = [
        (t - START) / DAY
        for j, t, items in zip(r["joint"], r["time_s"], r[column], strict=True)
        if j == joint and any((i if isinstance(i, str) else i["name"]) == name for i in items)
    ]
    days = sorted({int(d) for d in named if d >= wear.since})
    return (
        float(days[settings.fewest_named - 1] + 1 - wear.since)
        if len(days) >= settings.fewest_named
        else None
    )


def _limit_of_parameter(made: Fleet, joint: str, wear: Wear, about: str) -> float | None:
    h = made.history
    rows = (h["joint"] == joint) & (h["parameter"] == about) & h["identifiable"]
    day, value = (h["time_s"][rows] - START) / DAY, h["value"][rows]
    sd = np.maximum((h["high"] - h["low"])[rows] / 3.92 / value, 1e-9)
    change = abs(wear.size - 1.0) * wear.share(day)
    whole = np.floor(day).astype(int)
    for until in range(int(wear.since) + 2, 366):
        use = whole < until
        days, place = np.unique(whole[use], return_inverse=True)
        precision = np.bincount(place, 1.0 / sd[use] ** 2)
        weight = 1.0 / (1.0 / precision + DAY_SD[about] ** 2)
        profile = np.bincount(place, change[use]) / np.bincount(place)
        about_mean = profile - np.sum(weight * profile) / np.sum(weight)
        z = np.sqrt(np.sum(weight * about_mean**2))
        if z >= scan_threshold(TrendSettings().false_discovery / 20.0, min(0.4, 3.0 / len(days)), len(days)):
            return float(until - wear.since)
    return None


def table(outcomes: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield the lines of the table: required and measured values, then by kind of wear."""
    worn = [w for o in outcomes for w in o["worn"]]
    real = [w for w in worn if w["kind"] in RIGHT]
    dated = [
        abs(w["first_date_error"]) for w in worn if w["kind"] != "fault" and w["first_date_error"] is not None
    ]
    days = sum(o["joint_days"] for o in outcomes)
    false = [k for o in outcomes for k in o["false"]]
    right = sum(w["right"] for w in real)
    yield f"{'asked':<52}measured ({len(outcomes)} fleets)"
    share = 100.0 * right / len(real)
    yield f"{'worn joint and cause right >= 95 %':<52}{share:.1f} % ({right} of {len(real)})"
    yield f"{'change date within 14 days (median)':<52}{np.median(dated):.1f} days"
    rate = 1000.0 * len(false) / days
    yield f"{'false alarms <= 1 per 1000 joint-days':<52}{rate:.3f} ({len(false)} in {days})"
    yield ""
    yield f"{'':<14}{'right':>9}{'date error, days':>24}{'delay, days':>22}{'limit, days':>22}"
    for kind in dict.fromkeys(w["kind"] for w in worn):
        group = [w for w in worn if w["kind"] == kind]
        yield f"{kind:<14}{sum(w['right'] for w in group):>4} of {len(group):<3}" + "".join(
            f"{_spread([w[n] for w in group]):>22}" for n in ("first_date_error", "delay", "limit")
        )
    beside = [k for o in outcomes for k in o["beside"]]
    yield f"other alarms of worn joints after their wear began: {len(beside)} ({_names(beside)})"
    yield f"false alarms: {_names(false) or 'none'}"


def _spread(values: Sequence[float | None]) -> str:
    known = [v for v in values if v is not None]
    if not known:
        return "-"
    return f"{np.median(known):.0f} ({min(known):.0f} to {max(known):.0f})"


def _names(keys: Sequence[str]) -> str:
    names = ["/".join(k.split("/")[1:3]) for k in keys]
    return ", ".join(f"{names.count(n)} {n}" for n in dict.fromkeys(names))


def main(argv: Sequence[str]) -> int:
    """Play the fleets that the log does not hold yet, and print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--log", type=Path, required=True, help="JSON lines, a fleet each")
    parser.add_argument("--seeds", type=int, default=10, help="fleets (default %(default)s)")
    parser.add_argument(
        "--seconds", type=float, default=200.0, help="begin no fleet after this time, s (%(default)s)"
    )
    parser.add_argument(
        "--values", choices=("parameters", "identified"), default="parameters",
        help="the rig's values beside a diagnosis's causes, or those of a fit without causes (%(default)s)",
    )  # fmt: skip
    args = parser.parse_args(argv)
    end = time.perf_counter() + args.seconds
    done = {o["seed"]: o for o in read_lines(args.log)}
    for seed in range(args.seeds):
        if seed not in done and time.perf_counter() < end:
            done[seed] = outcome(seed, args.values)
            append_line(args.log, done[seed])
    drawn = f"{args.values} and causes drawn from a played sample"
    print(f"simulated: {drawn}; {len(done)} of {args.seeds} fleets")
    print("\n".join(table([done[s] for s in sorted(done)])))
    return 0
