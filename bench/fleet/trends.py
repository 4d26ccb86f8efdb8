"""Ten simulated fleets over a year through trends and alarms of `rsea fleet`: required and measured values.

python -m bench fleet trends --log out/fleets.jsonl [--seeds 10] [--minutes 3]

A fleet: 20 joints, 500 recordings each, a season of temperature, a day effect, normal work. Five wear, one is
replaced, three get faults of the data. Every week of the year `alarms` looks at the recordings so
far, as `rsea fleet watch` does. The results of a recording are drawn from a played sample
(trends_played.py), because diagnosing 100 000 recordings would take a week. The log goes on
where it stopped.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bench.fleet.simulated import DAY, START, Fleet, Wear, fleet
from bench.results import read_lines, resumed
from rsea_ros.trends import Alarm, alarms
from rsea_ros.trends.alarms import by_joint

VALUES = ("parameters", "identified")
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
    """Return whether the joint's first finding is right, its date's error, and the delay."""
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
    }


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
    yield f"{'':<14}{'right':>9}{'date error, days':>24}{'delay, days':>22}"
    for kind in dict.fromkeys(w["kind"] for w in worn):
        group = [w for w in worn if w["kind"] == kind]
        yield f"{kind:<14}{sum(w['right'] for w in group):>4} of {len(group):<3}" + "".join(
            f"{_spread([w[n] for w in group]):>22}" for n in ("first_date_error", "delay")
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


def main(
    *, log: Path, seeds: int = 10, minutes: float = 3.0, values: Annotated[str, VALUES] = "parameters"
) -> None:
    """Play the fleets that the log does not hold yet, and print the table.

    log: JSON lines, a fleet each
    seeds: fleets
    minutes: begin no fleet after this time
    values: the rig's values beside a diagnosis's causes, or those of a fit without causes
    """
    for _ in resumed(log, ((seed, partial(outcome, seed, values)) for seed in range(seeds)), "seed", minutes):
        pass
    done = sorted(read_lines(log), key=lambda o: int(o["seed"]))
    print(f"simulated: {values} and causes drawn from a played sample; {len(done)} of {seeds} fleets")
    print("\n".join(table(done)))
