"""Make, fit and score the probabilities of causes: reliability, Brier score, wrong names."""

import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench import ROOT
from bench.calibration.cases import Plan, plans, simulate_plan
from bench.results import Row, read_lines, resumed
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.diagnose import nominal_problem, search
from rsea_ros.diagnosis.evaluation import held_out_data
from rsea_ros.diagnosis.naming.evidence import Evidence, Signature
from rsea_ros.diagnosis.naming.flexible import Flexible
from rsea_ros.diagnosis.naming.status import COEFFICIENTS, features, probabilities_and_status
from rsea_ros.diagnosis.naming.weighing import Weighed, weigh
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.solver import worker_pools

CACHE = Path("out/calibration/evidence.jsonl")
TABLE = ROOT / "rsea_ros/diagnosis/naming/status.py"
OUTSIDE = ("off", "taken_out")
"""Beginnings of the names of groups whose record holds a law that the diagnosis cannot know."""
JUDGES = "second"
"""The plant that no coefficient is fitted on."""
EXPECTED = {
    "intercept": 0.0, "shape": -0.7, "rivals": 0.5, "preferred": 0.5, "noise": 0.5, "flexible": -3.0,
    "edge": -0.7,
}  # fmt: skip
"""Prior of the coefficients: their signs by theory, and sizes that a few records may overrule. Each has a
standard deviation of 1 around it, the intercept apart."""
ITERATIONS = 50
EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95, 0.99, 1.0)
"""Of the bins of the reliability; 0.85 to 0.95 are the causes with a probability of about 90 %."""


def make(*, cache: Path = CACHE, records: int = 600, seed: int = 12) -> Iterator[str]:
    """Diagnose records of known truth and keep the evidence; goes on where it stopped.

    cache: JSON lines, a record each
    records: how many
    seed: of the records; a cache for each
    """
    works = ((plan.name, partial(_entry, plan)) for plan in plans(records, seed))
    for entry in resumed(cache, works, "name"):
        first = [place[0] for place in entry.get("places", [])]
        marks = ("+" if e["name"] in entry["truth"] else "WRONG" for e in first)
        said = [f"{e['name']} {m} {e['signature']['overall']:.3f}" for e, m in zip(first, marks, strict=True)]
        truth = "+".join([*entry["truth"], *([f"({entry['off']})"] if entry["off"] else [])]) or "nothing"
        floor = "at floor" if entry.get("at_floor") else ""
        yield f"{entry['name']:<28} {truth:<50} {', '.join(said)} {floor} {entry['seconds']:.0f} s"
        yield from filter(None, [entry.get("error")])


def fit(*, cache: Path = CACHE) -> Iterator[str]:
    """Fit the coefficients to the plants that do not judge, and write their table.

    cache: JSON lines, a record each
    """
    entries = [e for e in usable(cache) if e["family"] != JUDGES]
    every = [(e, k == 0, r["truth"]) for r in entries for p in r["places"] for k, e in enumerate(p)]
    rows = [features(evidence_from(e), preferred) for e, preferred, _ in every]
    coefficients = fit_coefficients(rows, np.array([e["name"] in truth for e, _, truth in every], float))
    items = "".join(f'        "{name}": {value},\n' for name, value in coefficients.items())
    head, _, _ = TABLE.read_text().partition("COEFFICIENTS = ")
    TABLE.write_text(f"{head}COEFFICIENTS = MappingProxyType(\n    {{\n{items}    }}\n)\n")
    yield f"{len(entries)} records of {', '.join(sorted({e['family'] for e in entries}))}: {TABLE}"
    yield from (f"{name:<12}{value:8.3f}" for name, value in coefficients.items())


def score(*, cache: Path = CACHE) -> Iterator[Row | str]:
    """Score the probabilities on the plant that judges, and on those of the fit.

    cache: JSON lines, a record each
    """
    for title, chosen in (("The plant that judges", True), ("The plants that were fitted to", False)):
        entries = [e for e in usable(cache) if (e["family"] == JUDGES) == chosen]
        yield f"\n**{title}**: {len(entries)} records"
        yield from table(list(probabilities_of(entries)))


def usable(cache: Path) -> list[dict[str, Any]]:
    """Return the entries of a cache that ended without an error."""
    return [e for e in read_lines(cache) if "error" not in e]


def _entry(plan: Plan) -> dict[str, Any]:
    """Return the outcome of one record; an exception is an outcome too."""
    start = time.perf_counter()
    entry = {"name": plan.name, "family": plan.family, "group": plan.group, "truth": list(plan.truth)}
    entry |= {"off": plan.off[0] if plan.off else None, "excitation": plan.excitation, "sizes": plan.hidden}
    try:
        entry |= _weigh(plan)
    except Exception:
        entry["error"] = traceback.format_exc(limit=-3)
    return entry | {"seconds": round(time.perf_counter() - start, 2)}


def _weigh(plan: Plan) -> dict[str, Any]:
    settings = DiagnosisSettings(without=plan.without)
    with worker_pools() as pools:
        record, rig = simulate_plan(plan)
        checked = check(record, rig)
        nominal = nominal_problem([checked], rig)
        selection, stages = search(nominal, checked.record, None, pools, lambda step, share: None, settings)
        places = weigh(selection, stages, held_out_data(selection, None), pools, settings)
    floors = {"nothing_wrong": is_at_floor(stages[0].test), "at_floor": is_at_floor(stages[-1].test)}
    return floors | {"places": [_place(p) for p in places]}


def _place(place: Sequence[Weighed]) -> list[dict[str, Any]]:
    """Return the evidence for a cause and its rivals, with the size that each has."""
    weighed = []
    for w in place:
        sizes = zip(w.claim.problem.unknowns, w.claim.theta, strict=True)
        own = [(u, theta) for u, theta in sizes if u.name.startswith(f"{w.claim.name}.")]
        values = {u.name.split(".")[1]: u.outer(float(theta)) for u, theta in own}
        weighed.append(asdict(w.evidence) | {"values": values})
    return weighed


def evidence_from(entry: Mapping[str, Any]) -> Evidence:
    """Return the evidence that a cache holds."""
    values = {k: v for k, v in entry.items() if k != "values"}
    flexible = values["flexible"]
    values["flexible"] = flexible and Flexible(**{**flexible, "ci95": tuple(flexible["ci95"])})
    return Evidence(**{**values, "signature": Signature(**values["signature"])})


def fit_coefficients(rows: Sequence[Mapping[str, float]], right: np.ndarray) -> dict[str, float]:
    """Return the coefficients of greatest posterior probability, by Newton's method."""
    names = list(rows[0])
    x, before = np.array([list(f.values()) for f in rows]), np.array([EXPECTED[n] for n in names])
    ridge = np.diag([1e-9 if n == "intercept" else 1.0 for n in names])
    a = before.copy()
    for _ in range(ITERATIONS):
        p = 1.0 / (1.0 + np.exp(-x @ a))
        slope = x.T @ (right - p) - ridge @ (a - before)
        a = a + np.linalg.solve(x.T @ (x * (p * (1.0 - p))[:, None]) + ridge, slope)
    return {n: round(float(v), 4) for n, v in zip(names, a, strict=True)}


class Said(NamedTuple):
    """One named cause of one record: its probability, whether it is right, whether it is only a rival."""

    group: str
    probability: float
    status: str | None
    right: bool
    is_rival: bool
    has_right_rival: bool


def probabilities_of(
    entries: Sequence[Mapping[str, Any]], coefficients: Mapping[str, float] = COEFFICIENTS
) -> Iterator[Said]:
    """Yield the probability of every cause and rival of some records."""
    for record in entries:
        for place in record["places"]:
            evidence = [evidence_from(e) for e in place]
            likely, status = probabilities_and_status(evidence, record["at_floor"], coefficients=coefficients)
            rights = [e.name in record["truth"] for e in evidence]
            for k, (p, right) in enumerate(zip(likely, rights, strict=True)):
                yield Said(record["group"], p, None if k else status, right, k > 0, any(rights[1:]))


def table(causes: Sequence[Said]) -> Iterator[Row | str]:
    """Yield the Brier score of the probabilities, their reliability, and how many of each status are right.

    `one_of` is right when one of its rivals is.
    """
    brier = float(np.mean([(c.probability - c.right) ** 2 for c in causes]))
    yield f"{len(causes)} causes and rivals weighed, Brier score {brier:.3f}"
    for low, high in pairwise(EDGES):
        inside = [c for c in causes if low <= c.probability < high or c.probability == high == 1.0]
        if inside:
            said, right = (np.mean([getattr(c, n) for c in inside]) for n in ("probability", "right"))
            told = {"causes": str(len(inside)), "mean stated": f"{said:.2f}", "right": f"{right:.2f}"}
            yield Row(f"{low:.2f} to {high:.2f}", "", told)
    for status in ("confirmed", "leading", "one_of", None):
        of = [c for c in causes if not c.is_rival and c.status == status]
        wrong = [c for c in of if not (c.right or (status == "one_of" and c.has_right_rival))]
        told = {"causes": str(len(of)), "right": str(len(of) - len(wrong)), "wrong": str(len(wrong))}
        told |= {"wrong, %": f"{100.0 * len(wrong) / max(len(of), 1):.1f}"}
        outside = sum(c.group.startswith(OUTSIDE) for c in wrong)
        yield Row(status or "not named", "", told | {"of the wrong, law not in the catalogue": str(outside)})
