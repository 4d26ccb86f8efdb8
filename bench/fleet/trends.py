"""Simulated fleets over a year through trends and alarms of `rsea fleet`: required and measured values.

A fleet: 20 joints of test/independent, 500 recordings each, a season of temperature, a day effect, normal
work. Five joints wear, one is replaced, three get faults of the data. Every week of the year `alarms` looks
at the recordings so far, as `rsea fleet watch` does. What a recording tells is drawn from SHOWN and NAMED:
medians of 108 recordings of that work and wear that were diagnosed in full (November 2026).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from independent.bench import drawn_bench

from bench.results import Row, read_lines, resumed
from rsea_extras.trends import Alarm, alarms
from rsea_extras.trends.alarms import by_joint

START, DAY = 1_735_689_600.0, 86400.0
"""2025-01-01 UTC, s."""
WEEK, FIRST = 7, 28
"""Days between looks; the first look."""
JOINTS, RECORDINGS, DAYS = 20, 500, 365
MIX = {"handling": 0.4, "stepping": 0.15, "walking": 0.25, "holding": 0.2}
"""Kinds of work: loads picked, placed and stepped, a gait, loads that are held; no chirps."""
PARAMETERS = {
    "rotor.reflected_inertia": ("j_m", "kg m^2", 0.003, 0.0),
    "rotor.reflected_damping": ("b_m", "N m s/rad", 0.03, -0.012),
    "spring.stiffness": ("k_s", "N m/rad", 0.005, -3e-4),
    "spring.damping": ("b_s", "N m s/rad", 0.05, 0.0),
}
"""Name on the second bench, unit, relative effect of a day (one sigma: mounting, grease) and of 1 K."""
SHOWN = {
    "handling": ((3e-4, 1.0), (7e-3, 0.2), (2e-5, 1.0), (0.05, 0.0)),
    "stepping": ((1e-4, 1.0), (4e-3, 0.9), (2e-5, 1.0), (0.035, 0.2)),
    "walking": ((5e-5, 1.0), (5e-3, 0.9), (2e-5, 1.0), (0.035, 0.5)),
    "holding": ((2e-2, 0.04), (2.5e-2, 0.2), (3e-4, 1.0), (0.14, 0.0)),
}
"""By work, in the order of PARAMETERS: relative sigma, and the share of recordings that determine it."""
NAMED = {
    "coulomb_friction": ("torque", "N m", 1.0, 0.0, 0.04, -0.012, 0.3, 0.95, 0.95, 0.004),
    "backlash": ("gap", "rad", 0.0, 0.0, 0.03, 0.0, 6e-5, 0.97, 0.75, 0.005),
    "command_delay": ("delay", "s", 0.0, 0.0, 0.0, 0.0, 7e-4, 0.97, 0.0, 0.01),
    "ft_gain_error": ("gain", "1", 1.0, 1.0, 0.002, 0.0, 0.025, 0.9, 0.5, 0.002),
}
"""By cause: its size, unit, value of a new joint, the value that is none, effect of a day and of 1 K, the
least difference from none that is named, the share of recordings that name it, of those with held loads,
sigma."""
WRONG = 0.02
"""Share of recordings that name a motor constant which is right."""
SPOILT = ("dropped_samples", "outliers", "frozen_samples")
RIGHT = {
    "stiffness": ("spring.stiffness",),
    "friction": ("rotor.reflected_damping", "coulomb_friction.torque"),
    "gap": ("backlash",),
    "delay": ("command_delay",),
    "ft_gain": ("ft_gain_error",),
}
"""Right subjects of an alarm, by kind of wear. A replaced joint may differ in anything."""
Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Wear:
    """The wear of a joint. kind: a key of RIGHT, `replaced` or `fault`. size: at the end.

    since: day of the year. ramp: days over which it comes, 0 for at once.
    """

    kind: str
    size: float = 0.0
    since: float = 0.0
    ramp: float = 0.0
    fault: str = ""

    def share(self, day: np.ndarray) -> np.ndarray:
        """Return the share of the wear that has occurred, 0 to 1."""
        if self.ramp:
            return np.clip((day - self.since) / self.ramp, 0.0, 1.0)
        return (day >= self.since).astype(float)


def drawn_wear(rng: np.random.Generator) -> dict[str, Wear]:
    """Return the wear of each joint: five wear, one is replaced, three get faults of the data."""
    names = [f"J{i + 1:02d}" for i in rng.permutation(JOINTS)]
    when = rng.uniform(0.2, 0.55, 5) * DAYS
    sizes = {"stiffness": 0.85, "friction": 1.5, "gap": 4.0e-3, "delay": 2.5e-3, "ft_gain": 0.9}
    slow = ("stiffness", "friction", "gap")
    kinds = [
        Wear(kind, size, since, rng.uniform(60.0, 120.0) if kind in slow else 0.0)
        for (kind, size), since in zip(sizes.items(), when, strict=True)
    ]
    kinds.append(Wear("replaced", 0.0, rng.uniform(0.45, 0.55) * DAYS))
    kinds += [Wear("fault", 0.0, rng.uniform(0.2, 0.6) * DAYS, 0.0, fault) for fault in SPOILT]
    return dict(zip(names, kinds, strict=False))


def fleet(seed: int) -> tuple[Columns, Columns, Mapping[str, Wear]]:
    """Return the history and the recordings of the fleet of a seed, and what happens to its joints."""
    rng = np.random.default_rng([seed, 16])
    wear = drawn_wear(rng)
    season = 25.0 + 8.0 * np.sin(2.0 * np.pi * (np.arange(DAYS) / 365.25 - 0.3)) + 2.0 * rng.normal(size=DAYS)
    names = [f"J{i + 1:02d}" for i in range(JOINTS)]
    parts = [_joint(name, wear.get(name), season, rng) for name in names]
    history, recordings = (
        {n: np.concatenate([part[k][n] for part in parts]) for n in parts[0][k]} for k in (0, 1)
    )
    return history, recordings, wear


def _joint(name: str, wear: Wear | None, season: np.ndarray, rng: np.random.Generator) -> tuple[Columns, ...]:
    """Return the columns of a joint, of its history by parameter and time, and of its recordings."""
    n = RECORDINGS
    days = np.flatnonzero(np.arange(DAYS) % 7 < 5)
    time_of = np.sort(rng.choice(days, n) + rng.uniform(0.33, 0.75, n))
    day = time_of.astype(int)
    warm = season[day] + rng.uniform(0.0, 6.0, n)
    share = wear.share(time_of) if wear else np.zeros(n)
    mixes = [rng.dirichlet(40.0 * np.array(list(MIX.values()))) for _ in range(2)]
    late = time_of > rng.uniform(0.3, 0.7) * DAYS
    work = np.where(late, rng.choice([*MIX], n, p=mixes[1]), rng.choice([*MIX], n, p=mixes[0]))
    bench, other = (drawn_bench(rng).plant._asdict() for _ in range(2))
    names = np.array([f"{name}-{k:04d}" for k in range(n)])
    common = {"joint": np.full(n, name), "recording": names, "time_s": START + DAY * time_of,
              "artefacts": np.char.add(f"artefacts/{name}/", names)}  # fmt: skip
    replaced = (share > 0.0) & (wear is not None and wear.kind == "replaced")

    def true(what: str, new: np.ndarray, null: float, day_sd: float, per_kelvin: float) -> np.ndarray:
        """Return a value as it is at each recording."""
        value = new
        if wear and what in {about.split(".torque")[0] for about in RIGHT.get(wear.kind, ())}:
            value = np.where(new == 0.0, share * wear.size, new * (1.0 + share * (wear.size - 1.0)))
        shaken = (value - null) * (1.0 + day_sd * rng.normal(size=DAYS)[day])
        return null + shaken * (1.0 + per_kelvin * (warm - 25.0))

    parts = []
    for k, (what, (alias, unit, day_sd, per_kelvin)) in enumerate(PARAMETERS.items()):
        value = true(what, np.where(replaced, other[alias], bench[alias]), 0.0, day_sd, per_kelvin)
        sigma, told = np.array([SHOWN[kind][k] for kind in work]).T
        seen = value * (1.0 + sigma * rng.normal(size=n))
        parts.append(common | {
            "parameter": np.full(n, what), "unit": np.full(n, unit), "value": seen,
            "low": seen - 1.96 * sigma * value, "high": seen + 1.96 * sigma * value,
            "identifiable": rng.random(n) < told, "temperature": warm,
        })  # fmt: skip
    causes, faults = (np.array([[] for _ in range(n)] + [None], dtype=object)[:n] for _ in range(2))
    for what, (size, unit, new, null, day_sd, per_kelvin, least, usual, held, doubt) in NAMED.items():
        value = true(what, np.full(n, new), null, day_sd, per_kelvin)
        named = rng.random(n) < np.where(work == "holding", held, usual)
        for k in np.flatnonzero(named & (np.abs(value - null) >= least)):
            causes[k].append(_cause(what, size, unit, value[k], doubt * abs(value[k] - null), rng))
    for k in np.flatnonzero(rng.random(n) < WRONG):
        causes[k].append(_cause("torque_constant_error", "gain", "1", 1.01, 3e-3, rng))
    if wear and wear.fault:
        for k in np.flatnonzero((share > 0.0) & (rng.random(n) < 0.7)):
            faults[k].append({"kind": wear.fault})
    history = {c: np.concatenate([part[c] for part in parts]) for c in parts[0]}
    recordings = common | {"outcome": np.full(n, "done"), "verdict": np.full(n, "explained"),
                           "residual": np.ones(n), "faults": faults, "causes": causes}  # fmt: skip
    return history, recordings


def _cause(name: str, size: str, unit: str, true: float, sigma: float, rng: np.random.Generator) -> Any:
    seen = true + sigma * rng.normal()
    sizes = [{"name": size, "value": seen, "low": seen - 1.96 * sigma, "high": seen + 1.96 * sigma,
              "unit": unit}]  # fmt: skip
    return {"name": name, "status": "confirmed", "probability": 0.95, "gain": 0.8, "sizes": sizes}


def outcome(seed: int) -> dict[str, Any]:
    """Return the outcome of the fleet of a seed."""
    history, recordings, wear = fleet(seed)
    first: dict[str, tuple[float, Alarm]] = {}
    last: tuple[Alarm, ...] = ()
    for day in (*range(FIRST, DAYS, WEEK), DAYS):
        until = START + DAY * day
        seen = ({n: c[t["time_s"] < until] for n, c in t.items()} for t in (history, recordings))
        last = alarms(*seen)
        for alarm in last:
            first.setdefault(alarm.key, (float(day), alarm))
    groups = by_joint(last)
    return {
        "seed": seed,
        "worn": [_judged(joint, w, groups.get(joint, []), first) for joint, w in wear.items()],
        "false": [a.key for d, a in first.values() if _is_false(wear.get(a.joint), d, a)],
    }


def _is_false(wear: Wear | None, day: float, alarm: Alarm) -> bool:
    """Return whether nothing had happened to the joint when it was alarmed, or only to its data."""
    if wear is None or day < wear.since:
        return True
    return wear.kind == "fault" and alarm.about != wear.fault


def _judged(
    joint: str, wear: Wear, final: Sequence[Alarm], first: Mapping[str, tuple[float, Alarm]]
) -> dict[str, Any]:
    """Return whether the joint's first finding is right, its date's error, and the delay, days."""
    names = RIGHT.get(wear.kind, (wear.fault,) if wear.fault else ())
    right = [a for a in final if not names or a.about in names]
    seen = [d for d, a in first.values()
            if a.joint == joint and d >= wear.since and (not names or a.about in names)]  # fmt: skip
    dates = [(a.since_s - START) / DAY - wear.since for a in right if np.isfinite(a.since_s)]
    return {
        "kind": wear.kind, "right": bool(right) and (not names or final[0].about in names),
        "date_error": float(dates[0]) if dates else None,
        "delay": float(min(seen) - wear.since) if seen else None,
    }  # fmt: skip


def main(*, log: Path, seeds: int = 10, minutes: float = 3.0) -> Iterator[Row]:
    """Play simulated fleets over a year: required and measured values, then a row for each kind of wear.

    log: JSON lines, a fleet each; goes on where it ends
    seeds: fleets
    minutes: begin no fleet after this time
    """
    for _ in resumed(log, ((seed, partial(outcome, seed)) for seed in range(seeds)), "seed", minutes):
        pass
    done = read_lines(log)
    worn, false = [w for o in done for w in o["worn"]], [key for o in done for key in o["false"]]
    right = [w["right"] for w in worn if w["kind"] in RIGHT]
    dated = [abs(w["date_error"]) for w in worn if w["kind"] != "fault" and w["date_error"] is not None]
    days = JOINTS * DAYS * len(done)
    yield Row("worn joint and cause right", ">= 95 %", f"{100.0 * np.mean(right):.1f} % of {len(right)}")
    yield Row("change date, median error", "<= 14 days", f"{np.median(dated):.1f} days")
    rate = f"{1000.0 * len(false) / days:.3f}: {len(false)} in {days}; {', '.join(false) or 'none'}"
    yield Row("false alarms in 1000 joint-days", "<= 1", rate)
    for kind in dict.fromkeys(w["kind"] for w in worn):
        group = [w for w in worn if w["kind"] == kind]
        told = f"right {sum(w['right'] for w in group)} of {len(group)}"
        for name in ("date_error", "delay"):
            known = [w[name] for w in group if w[name] is not None] or [np.nan]
            told += f"; {name} {np.median(known):.0f} ({min(known):.0f} to {max(known):.0f}) days"
        yield Row(kind, "", told)
