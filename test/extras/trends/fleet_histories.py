"""Histories with a known truth: a level, what happens to it, day effects, temperature and intervals."""

from __future__ import annotations

import numpy as np

START, DAY = 1_735_689_600.0, 86400.0  # 2025-01-01 UTC


def history(
    rng, joints=("a",), parameter="spring.stiffness", level=1500.0, course=None, days=250, each=2, sd=0.004,
    day_sd=0.006, per_kelvin=0.0, temperature=None, told=1.0,
):  # fmt: skip
    """Return a history. course: relative change by joint and day; sd, day_sd: relative."""
    parts = []
    for joint in joints:
        day = np.repeat(np.arange(days), each)
        n = len(day)
        warm = np.full(n, np.nan) if temperature is None else temperature(day, rng)
        value = 1.0 + (course(joint, day) if course else 0.0) + day_sd * rng.normal(size=days)[day]
        value = value + sd * rng.normal(size=n)
        if temperature is not None:
            value = value + per_kelvin * (warm - 25.0)
        parts.append(_columns(rng, joint, parameter, day, level * value, 1.96 * level * sd, warm, told))
    return {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}


def _columns(rng, joint, parameter, day, value, half, warm, told):
    n = len(day)
    names = np.array([f"bag{i:05d}" for i in range(n)])
    texts = {"joint": np.full(n, joint), "parameter": np.full(n, parameter), "unit": np.full(n, "N m/rad")}
    when = {"time_s": START + DAY * (day + rng.uniform(0.3, 0.7, n)), "identifiable": rng.random(n) < told}
    numbers = {"value": value, "low": value - half, "high": value + half, "temperature": warm}
    return texts | when | numbers | {"recording": names, "artefacts": np.char.add("artefacts/", names)}


def recordings(joints=("a",), days=250, causes=None, faults=None):
    """Return a table of recordings, one a day. causes, faults: functions of joint and day."""
    rows = [
        {
            "joint": joint, "recording": f"bag{d:05d}", "time_s": START + DAY * (d + 0.5), "outcome": "done",
            "verdict": "adequate", "residual": 1.0, "faults": faults(joint, d) if faults else [],
            "causes": causes(joint, d) if causes else [], "artefacts": f"artefacts/bag{d:05d}",
        }
        for joint in joints
        for d in range(days)
    ]  # fmt: skip
    lists = {n: np.empty(len(rows), dtype=object) for n in ("faults", "causes")}
    for n, column in lists.items():
        column[:] = [r[n] for r in rows]
    return {n: lists[n] if n in lists else np.array([r[n] for r in rows]) for n in rows[0]}


def cause(name, size, parameter="gap", unit="rad", gain=0.5, doubt=0.02, status="confirmed", probability=0.9):
    """Return a cause in the form of the store."""
    low, high = size * (1 - doubt), size * (1 + doubt)
    sizes = [{"name": parameter, "value": size, "low": low, "high": high, "unit": unit}]
    return {"name": name, "status": status, "probability": probability, "gain": gain, "sizes": sizes}
