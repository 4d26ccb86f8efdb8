"""A fleet over a year: 20 joints of test/independent whose recordings are drawn from a played sample.

The results of a recording (errors, intervals, undetermined parameters, named causes, refusals) are drawn
from trends_played.json, where recordings of the same kind of work and of like wear were simulated and
diagnosed in full. Diagnosing 10 x 10 000 recordings would take a week.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from independent.bench import drawn_bench

from bench.fleet.plants import COULOMB, FRICTION_PER_K, STIFFNESS_PER_K
from bench.fleet.trends_played import SAMPLE, SPOILT, TRUE

START, DAY = 1_735_689_600.0, 86400.0
"""2025-01-01 UTC, s."""
UNITS = {
    "rotor.reflected_inertia": "kg m^2",
    "rotor.reflected_damping": "N m s/rad",
    "spring.stiffness": "N m/rad",
    "spring.damping": "N m s/rad",
}
DAY_SD = {
    "rotor.reflected_inertia": 0.003,
    "rotor.reflected_damping": 0.03,
    "spring.stiffness": 0.005,
    "spring.damping": 0.05,
    "coulomb_friction": 0.04,
    "backlash": 0.03,
    "command_delay": 0.0,
    "ft_gain_error": 0.002,
}
"""Relative one-sigma effect of a day: mounting, grease, zero of the sensors."""
PER_KELVIN = {
    "spring.stiffness": STIFFNESS_PER_K,
    "rotor.reflected_damping": FRICTION_PER_K,
    "coulomb_friction": FRICTION_PER_K,
}
TOLD = 0.5
"""Share that the data must have brought for a parameter to count as identifiable."""
MIX = {"handling": 0.4, "stepping": 0.15, "walking": 0.25, "holding": 0.2}


@dataclass(frozen=True)
class Wear:
    """The wear of a joint. kind: key of plants.joint, `replaced` or `fault`. size: at the end.

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


@dataclass(frozen=True)
class Fleet:
    """History, recordings and truth of one fleet."""

    history: Mapping[str, np.ndarray]
    recordings: Mapping[str, np.ndarray]
    wear: Mapping[str, Wear] = field(default_factory=dict)


def drawn_wear(rng: np.random.Generator, joints: int, days: int) -> dict[str, Wear]:
    """Return the wear of each joint: five wear, one is replaced, three get faults of the data."""
    names = [f"J{i + 1:02d}" for i in rng.permutation(joints)]
    when = rng.uniform(0.2, 0.55, 5) * days
    kinds = [
        Wear("stiffness", 0.85, when[0], rng.uniform(60.0, 120.0)),
        Wear("friction", 1.5, when[1], rng.uniform(60.0, 120.0)),
        Wear("gap", 4.0e-3, when[2], rng.uniform(60.0, 120.0)),
        Wear("delay", 2.5e-3, when[3]),
        Wear("ft_gain", 0.9, when[4]),
        Wear("replaced", 0.0, rng.uniform(0.45, 0.55) * days),
    ]
    kinds += [Wear("fault", 0.0, rng.uniform(0.2, 0.6) * days, 0.0, fault) for fault in SPOILT]
    return dict(zip(names, kinds, strict=False))


def fleet(
    seed: int, joints: int = 20, recordings: int = 500, days: int = 365, values: str = "parameters"
) -> Fleet:
    """Return a fleet of a seed.

    values: `parameters`, the rig's values beside the causes of a diagnosis, or `identified`, those of a fit
    that trusts the rig's structure.
    """
    rng = np.random.default_rng([seed, 16])
    played = [e for e in json.loads(SAMPLE.read_text()) if e["outcome"] != "error"]
    sample = [{**e, "parameters": e.get(values, {})} for e in played]
    wear = drawn_wear(rng, joints, days)
    season = 25.0 + 8.0 * np.sin(2.0 * np.pi * (np.arange(days) / 365.25 - 0.3)) + 2.0 * rng.normal(size=days)
    rows: list[dict[str, Any]] = []
    for i in range(joints):
        name = f"J{i + 1:02d}"
        rows += _joint(name, wear.get(name), sample, season, recordings, rng)
    return Fleet(_history(rows), _recordings(rows), wear)


def _joint(
    name: str, wear: Wear | None, sample: list[dict[str, Any]], season: np.ndarray, count: int,
    rng: np.random.Generator,
) -> list[dict[str, Any]]:  # fmt: skip
    days = len(season)
    work_days = np.flatnonzero(np.arange(days) % 7 < 5)
    day = np.sort(rng.choice(work_days, count))
    hour = np.sort(rng.uniform(0.33, 0.75, count))
    time = day + rng.permutation(hour)
    order = np.argsort(time)
    day, time = day[order], time[order]
    temperature = season[day] + rng.uniform(0.0, 6.0, count)
    new, other = (drawn_bench(rng) for _ in range(2))
    of_day = {n: sd * rng.normal(size=days) for n, sd in DAY_SD.items()}
    share = wear.share(time) if wear else np.zeros(count)
    mixes = [rng.dirichlet(40.0 * np.array(list(MIX.values()))) for _ in range(2)]
    turn = rng.uniform(0.3, 0.7) * days
    out = []
    for k in range(count):
        kind = str(rng.choice(list(MIX), p=mixes[int(time[k] > turn)]))
        replaced = wear is not None and wear.kind == "replaced" and share[k] > 0.0
        true = _true(other if replaced else new, wear, share[k], temperature[k])
        true = {n: _shaken(n, v, of_day[n][day[k]]) for n, v in true.items()}
        fault = wear.fault if wear and wear.fault and share[k] > 0.0 and rng.random() < 0.7 else ""
        state = (
            {} if wear is None or wear.kind in ("replaced", "fault") else {wear.kind: _size(wear, share[k])}
        )
        entry = _like(sample, kind, state, fault, rng)
        out.append(_row(name, k, START + DAY * time[k], temperature[k], entry, true, rng))
    return out


def _size(wear: Wear, share: float) -> float:
    null = 0.0 if wear.kind in ("gap", "delay") else 1.0
    return null + share * (wear.size - null)


def _true(bench: Any, wear: Wear | None, share: float, temperature: float) -> dict[str, float]:
    """Return the joint's values as they are at a recording, without the effect of the day."""
    true = {n: bench.plant._asdict()[alias] for n, alias in TRUE.items()}
    true |= {"coulomb_friction": COULOMB, "backlash": 0.0, "command_delay": 0.0, "ft_gain_error": 1.0}
    size = _size(wear, share) if wear else 0.0
    if wear and wear.kind == "stiffness":
        true["spring.stiffness"] *= size
    if wear and wear.kind == "friction":
        true["rotor.reflected_damping"] *= size
        true["coulomb_friction"] *= size
    if wear and wear.kind in ("gap", "delay", "ft_gain"):
        true[{"gap": "backlash", "delay": "command_delay", "ft_gain": "ft_gain_error"}[wear.kind]] = size
    return {n: v * (1.0 + PER_KELVIN.get(n, 0.0) * (temperature - 25.0)) for n, v in true.items()}


def _shaken(name: str, value: float, by: float) -> float:
    return 1.0 + (value - 1.0) * (1.0 + by) if name == "ft_gain_error" else value * (1.0 + by)


def _like(
    sample: list[dict[str, Any]], kind: str, state: Mapping[str, float], fault: str, rng: np.random.Generator
) -> dict[str, Any]:
    """Return a played recording of the same work whose joint has about the same wear, or the same fault."""
    same = [e for e in sample if e["kind"] == kind and e["fault"] == fault]
    what, size = next(iter(state.items()), ("", 0.0))
    away = [_distance(e["wear"], what, size) for e in same]
    nearest = [e for e, d in zip(same, away, strict=True) if d <= min(away) + 1e-9]
    return nearest[int(rng.integers(len(nearest)))]


def _distance(wear: Mapping[str, float], what: str, size: float) -> float:
    """Return the difference of a played joint's wear, in logarithms of its factors."""
    null = 0.0 if what in ("gap", "delay") else 1.0
    floor = {"gap": 0.015e-3, "delay": 0.1e-3}.get(what, 0.005)
    if wear and what not in wear:
        return 99.0
    off = [abs(v - null) for v in (wear.get(what, null), size)]
    return abs(float(np.log(max(off[0], floor) / max(off[1], floor))))


def _row(
    name: str, k: int, time: float, temperature: float, entry: Mapping[str, Any], true: Mapping[str, float],
    rng: np.random.Generator,
) -> dict[str, Any]:  # fmt: skip
    return {
        "joint": name,
        "recording": f"{name}-{k:04d}",
        "time_s": time,
        "temperature": temperature,
        "outcome": entry["outcome"],
        "verdict": entry.get("verdict", ""),
        "faults": entry.get("faults", []),
        "residual": entry.get("times_noise", float("nan")),
        "artefacts": f"artefacts/{name}/{name}-{k:04d}",
        "parameters": {
            n: _estimate(v, entry["true"][n], true[n], rng) for n, v in entry.get("parameters", {}).items()
        },
        "causes": [_cause(c, entry, true, rng) for c in entry.get("causes", [])],
    }


def _estimate(played: list[float], was: float, true: float, rng: np.random.Generator) -> tuple[float, ...]:
    """Return value, low, high and data share: the played error and interval, relative, on another truth."""
    value, low, high, told = played
    shift = (high - low) / 3.92 * float(rng.normal())
    return (*(true * (v + shift) / was for v in (value, low, high)), told)


def _cause(
    cause: Mapping[str, Any], entry: Mapping[str, Any], true: Mapping[str, float], rng: np.random.Generator
) -> dict[str, Any]:
    name, (parameter, played) = cause["name"], next(iter(cause["sizes"].items()))
    null = 1.0 if parameter == "gain" else 0.0
    was, now = entry["true"].get(name, np.nan) - null, true.get(name, np.nan) - null
    ratio = now / was if np.isfinite(was) and was and np.isfinite(now) else 1.0
    shift = (played[2] - played[1]) / 3.92 * float(rng.normal())
    value, low, high = (
        sorted(null + ratio * (v - null + shift) for v in played)[1],
        *sorted(null + ratio * (v - null + shift) for v in (played[1], played[2])),
    )
    unit = {"torque": "N m", "gap": "rad", "delay": "s", "gain": "1"}.get(parameter, "1")
    size = {"name": parameter, "value": value, "low": low, "high": high, "unit": unit}
    kept = {n: cause[n] for n in ("name", "status", "probability", "gain")}
    return {**kept, "sizes": [size]}


def _history(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    flat = [
        (r["joint"], n, UNITS[n], r["time_s"], *v[:3], v[3] >= TOLD, r["temperature"], r["recording"],
         r["artefacts"])
        for r in rows
        for n, v in r["parameters"].items()
    ]  # fmt: skip
    names = ("joint", "parameter", "unit", "time_s", "value", "low", "high", "identifiable", "temperature",
             "recording", "artefacts")  # fmt: skip
    columns = dict(zip(names, map(np.array, zip(*flat, strict=True)), strict=True))
    order = np.lexsort((columns["time_s"], columns["parameter"], columns["joint"]))
    return {n: c[order] for n, c in columns.items()}


def _recordings(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    names = ("joint", "recording", "time_s", "outcome", "verdict", "residual", "artefacts")
    out: dict[str, np.ndarray] = {n: np.array([r[n] for r in rows]) for n in names}
    for n in ("faults", "causes"):
        out[n] = np.empty(len(rows), dtype=object)
        out[n][:] = [r[n] for r in rows]
    return out
