"""Fit the probability of a cause to cached evidence, and score it: reliability, Brier score, wrong names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

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
"""Of the bins of the reliability diagram; 0.85 to 0.95 are the causes with a probability of about 90 %."""


@dataclass(frozen=True)
class Said:
    """One named cause of one record: its probability, whether it is right, whether it is only a rival."""

    record: str
    group: str
    name: str
    probability: float
    status: str | None
    right: bool
    is_rival: bool
    has_right_rival: bool


@dataclass(frozen=True)
class Bin:
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
            for k, (e, p, right) in enumerate(zip(evidence, likely, rights, strict=True)):
                yield Said(
                    record["name"], record["group"], e.name, p, None if k else status, right, k > 0, rest
                )


def reliability(causes: Sequence[Said]) -> list[Bin]:
    """Return the bins of the probability that hold any cause."""
    bins = []
    for low, high in pairwise(EDGES):
        inside = [c for c in causes if low <= c.probability < high or c.probability == high == 1.0]
        if inside:
            mean = float(np.mean([c.probability for c in inside]))
            bins.append(Bin(low, high, len(inside), mean, float(np.mean([c.right for c in inside]))))
    return bins


def brier(causes: Sequence[Said]) -> float:
    """Return the mean square of probability less outcome."""
    return float(np.mean([(c.probability - c.right) ** 2 for c in causes]))


def table(causes: Sequence[Said]) -> list[str]:
    """Return the score of the probabilities as lines of Markdown."""
    lines = [f"{len(causes)} causes and rivals weighed, Brier score {brier(causes):.3f}", ""]
    lines += ["| stated probability | causes | mean stated | right |", "|---|--:|--:|--:|"]
    for b in reliability(causes):
        lines.append(f"| {b.low:.2f} to {b.high:.2f} | {b.count} | {b.said:.2f} | {b.right:.2f} |")
    lines += ["", "| status | causes | right | wrong | wrong, % | of the wrong, law not in the catalogue |"]
    lines += ["|---|--:|--:|--:|--:|--:|"]
    return [*lines, *(_status_line(causes, status) for status in ("confirmed", "leading", "one_of", None))]


def _status_line(causes: Sequence[Said], status: str | None) -> str:
    """Return how many causes of a status are right; `one_of` is when one of its rivals is."""
    of = [c for c in causes if not c.is_rival and c.status == status]
    wrong = [c for c in of if not (c.right or (status == "one_of" and c.has_right_rival))]
    outside = [c for c in wrong if c.group.startswith(OUTSIDE)]
    share = 100.0 * len(wrong) / max(len(of), 1)
    counts = f"{len(of)} | {len(of) - len(wrong)} | {len(wrong)} | {share:.1f} | {len(outside)}"
    return f"| {status or 'not named'} | {counts} |"


def diagram(bins: Sequence[Bin]) -> str:
    """Return the reliability diagram as SVG: share that is right over stated probability, size by count."""
    size, edge = 320.0, 40.0
    at = [(edge + size * b.said, edge + size * (1.0 - b.right)) for b in bins]
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{3.0 + np.sqrt(b.count):.1f}" fill="#0072b2" opacity="0.6">'
        f"<title>{b.count} causes said with {b.said:.2f}: {b.right:.2f} right</title></circle>"
        for (x, y), b in zip(at, bins, strict=True)
    )
    marks = "".join(
        f'<text x="{edge + size * v:.0f}" y="{edge + size + 16:.0f}" text-anchor="middle">{v:g}</text>'
        f'<text x="{edge - 6:.0f}" y="{edge + size * (1.0 - v) + 4:.0f}" text-anchor="end">{v:g}</text>'
        for v in (0.0, 0.25, 0.5, 0.75, 1.0)
    )
    whole = size + 2.0 * edge
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {whole:g} {whole:g}" font-family="sans-serif" '
        f'font-size="12"><rect width="{whole:g}" height="{whole:g}" fill="#fff"/>'
        f'<rect x="{edge:g}" y="{edge:g}" width="{size:g}" height="{size:g}" fill="none" stroke="#999"/>'
        f'<path d="M{edge:g} {edge + size:g}L{edge + size:g} {edge:g}" stroke="#999" stroke-dasharray="4 4"/>'
        f'{marks}{dots}<text x="{edge + size / 2:g}" y="{whole - 8:g}" text-anchor="middle">'
        f'stated probability</text>'
        f'<text x="{edge:g}" y="{edge - 12:g}">share that is right; area by count</text></svg>\n'
    )
