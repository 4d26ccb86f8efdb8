"""Fit the probability of a cause to cached evidence, and score it: reliability, Brier score, wrong names."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from bench.results import Row
from rsea_ros.diagnosis.naming.evidence import Evidence, Signature
from rsea_ros.diagnosis.naming.flexible import Flexible
from rsea_ros.diagnosis.naming.status import COEFFICIENTS, features, probabilities_and_status

OUTSIDE = ("off", "taken_out")
"""Beginnings of the names of groups whose record holds a law that the diagnosis cannot know."""
JUDGES = "second"
"""The plant that no coefficient is fitted on."""
EXPECTED = {
    "intercept": 0.0,
    "shape": -0.7,
    "rivals": 0.5,
    "preferred": 0.5,
    "noise": 0.5,
    "flexible": -3.0,
    "edge": -0.7,
}
"""Prior of the coefficients: their signs by theory, and sizes that a few records may overrule."""
_RIDGE = 1.0
"""Of each coefficient, the intercept apart: a standard deviation of 1 around what is expected."""
_ITERATIONS = 50
EDGES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95, 0.99, 1.0)
"""Of the bins of the reliability; 0.85 to 0.95 are the causes with a probability of about 90 %."""


class Said(NamedTuple):
    """One named cause of one record: its probability, whether it is right, whether it is only a rival."""

    group: str
    probability: float
    status: str | None
    right: bool
    is_rival: bool
    has_right_rival: bool


class Bin(NamedTuple):
    """Causes with a probability of low to high: how many, their mean probability, the share that is right."""

    low: float
    high: float
    count: int
    said: float
    right: float


def evidence_from(entry: Mapping[str, Any]) -> Evidence:
    """Return the evidence that a cache holds."""
    values = {k: v for k, v in entry.items() if k != "values"}
    flexible = values["flexible"]
    values["flexible"] = flexible and Flexible(**{**flexible, "ci95": tuple(flexible["ci95"])})
    return Evidence(**{**values, "signature": Signature(**values["signature"])})


def rows(entries: Sequence[Mapping[str, Any]]) -> tuple[list[dict[str, float]], np.ndarray]:
    """Return the features of all evidence of some records, and whether each name is right, shape (n,)."""
    every = [(e, k == 0, r["truth"]) for r in entries for p in r["places"] for k, e in enumerate(p)]
    feature_rows = [features(evidence_from(e), preferred) for e, preferred, _ in every]
    return feature_rows, np.array([e["name"] in truth for e, _, truth in every], float)


def fit_coefficients(feature_rows: Sequence[Mapping[str, float]], right: np.ndarray) -> dict[str, float]:
    """Return the coefficients of greatest posterior probability, by Newton's method."""
    names = list(feature_rows[0])
    x = np.array([list(f.values()) for f in feature_rows])
    ridge = np.diag([1e-9 if n == "intercept" else _RIDGE for n in names])
    before = np.array([EXPECTED[n] for n in names])
    a = before.copy()
    for _ in range(_ITERATIONS):
        p = 1.0 / (1.0 + np.exp(-x @ a))
        slope = x.T @ (right - p) - ridge @ (a - before)
        a = a + np.linalg.solve(x.T @ (x * (p * (1.0 - p))[:, None]) + ridge, slope)
    return {n: round(float(v), 4) for n, v in zip(names, a, strict=True)}


def probabilities_of(
    entries: Sequence[Mapping[str, Any]], coefficients: Mapping[str, float] = COEFFICIENTS
) -> Iterator[Said]:
    """Yield the probability of every cause and rival of some records."""
    for record in entries:
        for place in record["places"]:
            evidence = [evidence_from(e) for e in place]
            likely, status = probabilities_and_status(evidence, record["at_floor"], coefficients=coefficients)
            rights = [e.name in record["truth"] for e in evidence]
            rest = any(rights[1:])
            for k, (p, right) in enumerate(zip(likely, rights, strict=True)):
                yield Said(record["group"], p, None if k else status, right, k > 0, rest)


def reliability(causes: Sequence[Said]) -> list[Bin]:
    """Return the bins of the probability that hold any cause."""
    bins = []
    for low, high in pairwise(EDGES):
        inside = [c for c in causes if low <= c.probability < high or c.probability == high == 1.0]
        if inside:
            mean = float(np.mean([c.probability for c in inside]))
            bins.append(Bin(low, high, len(inside), mean, float(np.mean([c.right for c in inside]))))
    return bins


def table(causes: Sequence[Said]) -> Iterator[Row | str]:
    """Yield the Brier score of the probabilities, their reliability, and how many of each status are right.

    `one_of` is right when one of its rivals is.
    """
    brier = float(np.mean([(c.probability - c.right) ** 2 for c in causes]))
    yield f"{len(causes)} causes and rivals weighed, Brier score {brier:.3f}"
    for b in reliability(causes):
        told = {"causes": str(b.count), "mean stated": f"{b.said:.2f}", "right": f"{b.right:.2f}"}
        yield Row(f"{b.low:.2f} to {b.high:.2f}", "", told)
    for status in ("confirmed", "leading", "one_of", None):
        of = [c for c in causes if not c.is_rival and c.status == status]
        wrong = [c for c in of if not (c.right or (status == "one_of" and c.has_right_rival))]
        counts = {"causes": len(of), "right": len(of) - len(wrong), "wrong": len(wrong)}
        told = {n: str(count) for n, count in counts.items()}
        told |= {"wrong, %": f"{100.0 * len(wrong) / max(len(of), 1):.1f}"}
        outside = sum(c.group.startswith(OUTSIDE) for c in wrong)
        yield Row(status or "not named", "", told | {"of the wrong, law not in the catalogue": str(outside)})
