"""Fits kept for the next run of the same record: another number of DiagnosisSettings repeats most of them.

A fit is a function of its problem, where it begins and how far it goes, so the outcome is the same.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from hashlib import blake2b
from typing import Any

import numpy as np

from rsea_ros.diagnosis import step_fits as screening
from rsea_ros.diagnosis.naming import evidence
from rsea_ros.identification import confidence, solver
from rsea_ros.identification.problem import Case, Problem


class Remembered:
    """Results by the digest of their inputs, and digests of cases as long as these live."""

    def __init__(self) -> None:
        self._results: dict[str, Any] = {}
        self._digests: dict[int, tuple[Case, str]] = {}

    def solve(self, problem: Problem, theta=None, *, run=solver.serial, matrix=None, **limits):
        """Return what solver.solve returns."""
        key = self._key("solve", problem, theta, sorted(limits.items()), matrix)
        return self._result(key, partial(_SOLVE, problem, theta, run=run, matrix=matrix, **limits))

    def screen(self, current, effect, guesses, rule):
        """Return what screening.screen returns."""
        limits = (rule.smaller_guess, rule.screening_steps, rule.screening_part)
        key = self._key(
            "screen", current.problem, current.theta, effect.name, guesses, current.jacobian, limits
        )
        return self._result(key, lambda: _SCREEN(current, effect, guesses, rule))

    def evidence_for(self, claim, cases, settings, run):
        """Return what evidence.evidence_for returns."""
        scores = (claim.with_it.sums, claim.without.sums, claim.with_it, claim.without)
        rules = (settings.blocks, settings.evidence, settings.acceptance)
        digests = [self._digest(c) for c in cases]
        key = self._key(
            "evidence", claim.problem, claim.theta, claim.name, claim.weight, *scores, *rules, *digests
        )
        return self._result(key, lambda: _EVIDENCE(claim, cases, settings, run))

    def confidence_of(self, solution):
        """Return what confidence.confidence_of returns."""
        key = self._key("confidence", solution.problem, solution.theta, solution.jacobian)
        return self._result(key, lambda: _CONFIDENCE(solution))

    def _result(self, key: str, make: Callable[[], Any]) -> Any:
        if key not in self._results:
            self._results[key] = make()
        return self._results[key]

    def _key(self, what: str, problem: Problem, *others: Any) -> str:
        cases = [self._digest(c) for c in problem.cases]
        stated = sorted(problem.stated)
        of_problem = (problem.rig, problem.unknowns, problem.channels, problem.on_angle, stated)
        return _hash(what, *cases, *of_problem, *others)

    def _digest(self, case: Case) -> str:
        if id(case) not in self._digests:
            parts = (case.drive, dict(case.noise), sorted(case.floating))
            arrays = [d[n] for d in (case.t, case.measured, case.mask) for n in sorted(d)]
            self._digests[id(case)] = (case, _hash(*parts, *arrays))
        return self._digests[id(case)][1]


_SOLVE, _SCREEN, _EVIDENCE = solver.solve, screening.screen, evidence.evidence_for
_CONFIDENCE = confidence.confidence_of


def _hash(*parts: Any) -> str:
    digest = blake2b(digest_size=16)
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        for part in parts:
            digest.update(part.tobytes() if isinstance(part, np.ndarray) else _text(part).encode())
            digest.update(b"|")
    return digest.hexdigest()


def _text(part: Any) -> str:
    """Return the representation of a part; of a drive, that of its fields, arrays by their bytes."""
    if not hasattr(part, "command"):
        return repr(part)
    fields = vars(part).items()
    return repr([(n, _hash(*v.values()) if isinstance(v, Mapping) else _hash(v)) for n, v in fields])


@contextmanager
def remember_fits() -> Iterator[None]:
    """Keep fits within a with statement, wherever the package has imported them."""
    kept = Remembered()
    modules = [m for name, m in sys.modules.items() if name.startswith("rsea_ros.diagnosis")]
    fits = (
        ("solve", _SOLVE, kept.solve), ("screen", _SCREEN, kept.screen),
        ("evidence_for", _EVIDENCE, kept.evidence_for), ("confidence_of", _CONFIDENCE, kept.confidence_of),
    )  # fmt: skip
    places = [(m, *fit) for m in modules for fit in fits if getattr(m, fit[0], None) is fit[1]]
    for module, name, _, new in places:
        setattr(module, name, new)
    try:
        yield
    finally:
        for module, name, old, _ in places:
            setattr(module, name, old)
