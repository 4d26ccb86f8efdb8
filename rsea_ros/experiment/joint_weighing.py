"""Causes weighed jointly over all runs.

A cause that the data cannot show weighs as much as no cause: it stays possible until a run could have shown
it. All causes have the same prior probability.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.experiment.fits import (
    fit_cause,
    information_of,
    log_evidence,
    problem_of,
    repeat_fits,
    scale_of,
)
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis
from rsea_ros.identification.problem import Case, case_from
from rsea_ros.identification.solver import Map, Solution, power, serial
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import BoolArray, FloatArray, Record

HOPELESS = 1e-6
"""Probability below which a cause is not fitted again to further records."""


@dataclass(frozen=True)
class WeighedCause:
    """A cause fitted to all records. log_evidence: see fits.py; left: RMS over the noise."""

    name: str
    solution: Solution
    log_evidence: float
    left: float


@dataclass(frozen=True)
class RunWeighing:
    """The result from all records. probability: by cause, for those not dropped before; they sum to 1."""

    cases: tuple[Case, ...]
    fits: Mapping[str, WeighedCause]
    probability: Mapping[str, float]
    scale: float

    @property
    def best(self) -> str:
        """The most likely cause."""
        return max(self.probability, key=lambda n: self.probability[n])

    @property
    def left(self) -> float:
        """RMS over the noise that the best cause leaves."""
        return self.fits[self.best].left

    def near_by_data(self, least: float) -> list[str]:
        """Return the causes of no more parameters than the best that fit less than `least` worse, in S.

        By the data alone, without their priors.
        """
        return [n for n in self._fit_as_well(least) if not self._is_richer(n)]

    def richer_by_data(self, least: float) -> list[str]:
        """Return the causes of more parameters than the best that fit less than `least` worse, in S.

        A cause that contains the best always does: what it adds may be absent, or not shown so far.
        """
        return [n for n in self._fit_as_well(least) if self._is_richer(n)]

    def _fit_as_well(self, least: float) -> list[str]:
        costs = {n: power(f.solution.residual) / self.scale for n, f in self.fits.items()}
        return [n for n, c in costs.items() if n != self.best and c - costs[self.best] < least]

    def _is_richer(self, name: str) -> bool:
        return len(self.fits[name].solution.theta) > len(self.fits[self.best].solution.theta)

    def hypotheses(self, least: float = 0.0) -> list[Hypothesis]:
        """Return the causes with a probability of at least `least`, the likeliest first."""
        names = sorted(self.probability, key=lambda n: -self.probability[n])
        return [self._hypothesis(n) for n in names if self.probability[n] >= least]

    def _hypothesis(self, name: str) -> Hypothesis:
        solution = self.fits[name].solution
        information = information_of(solution, self.scale)
        problem = replace(solution.problem, cases=())
        hypothesis = Hypothesis(name, problem, solution.theta, information, self.probability[name])
        return hypothesis.beside(self.best)


def cases_of(records: Sequence[Record], rig: Rig) -> tuple[Case, ...]:
    """Return records ready to be fitted, their faulty samples masked."""
    checked = [check(record, rig) for record in records]
    return tuple(_once(case_from(c.record, rig, c.masked)) for c in checked)


def _once(case: Case) -> Case:
    """Return a case in which a value that repeats counts once, in the middle of its run.

    In slow motion an encoder rounds many samples in a row to one count, by the same error: they are one
    observation, and taken as many they would turn the rounding of a turning point into physics.
    """
    return case.within({n: middles_of_runs(y) for n, y in case.measured.items()})


def middles_of_runs(y: FloatArray) -> BoolArray:
    """Return which samples stand in the middle of a run of equal values, shape (n,)."""
    begins = np.flatnonzero(np.diff(y, prepend=np.nan))
    ends = np.append(begins[1:], len(y))
    middle = np.zeros(len(y), bool)
    middle[(begins + ends - 1 + np.arange(len(begins)) % 2) // 2] = True
    return middle


def weigh(
    records: Sequence[Record],
    rig: Rig,
    causes: Sequence[str],
    before: RunWeighing | None = None,
    run: Map = serial,
) -> RunWeighing:
    """Weigh causes, and that there is none, by all records of a bench.

    before: the weighing of the earlier records; fits continue from it, and HOPELESS causes are left
    out. Raises IdentificationError for records from which nothing can be fitted.
    """
    cases = cases_of(records, rig)
    names = [NOTHING, *causes]
    if before is not None:
        names = [n for n in names if before.probability.get(n, 0.0) > HOPELESS]
    nominal = fit_cause(NOTHING, problem_of(NOTHING, rig, cases), _where(before, NOTHING), {}, run)
    near = dict(zip((u.name for u in nominal.problem.unknowns), nominal.theta, strict=True))
    solutions = {NOTHING: nominal}
    for name in (n for n in names if n != NOTHING):
        solutions[name] = fit_cause(name, problem_of(name, rig, cases), _where(before, name), near, run)
    return _weigh(repeat_fits(solutions, run), cases)


def _where(before: RunWeighing | None, name: str) -> FloatArray | None:
    """Return where the fit of a cause ended before, None for one that was not fitted."""
    return before.fits[name].solution.theta if before is not None and name in before.fits else None


def _weigh(solutions: Mapping[str, Solution], cases: tuple[Case, ...]) -> RunWeighing:
    scale = scale_of(solutions)
    fits = {n: WeighedCause(n, s, log_evidence(s, scale), _rms_left(s)) for n, s in solutions.items()}
    logs = np.array([f.log_evidence for f in fits.values()])
    shares = np.exp(logs - logs.max())
    return RunWeighing(cases, fits, dict(zip(fits, (shares / shares.sum()).tolist(), strict=True)), scale)


def _rms_left(solution: Solution) -> float:
    return float(np.sqrt(np.mean(solution.residual**2)))


SHORTEST = 4.2
"""s of a record, rest included, that the diagnosis takes."""


def diagnose_together(
    records: Sequence[Record], rig: Rig, causes: Sequence[str], tell: Progress | None = None
) -> Diagnosis:
    """Return the diagnosis of all records together, which weighs causes by held-out data."""
    others = tuple(name for name in catalogue() if name not in causes)
    return diagnose(list(records), rig, None, tell, DiagnosisSettings(without=others))


USUAL = (
    "coulomb_friction",
    "stribeck_friction",
    "backlash",
    "nonlinear_spring",
    "spring_hysteresis",
    "hard_stop",
    "torque_constant_error",
    "ft_gain_error",
    "command_delay",
    "ft_sensor_lag",
    "current_loop_lag",
    "torque_saturation",
)
"""Of a gear, a spring and their sensors. Each one more costs a fit a round."""


def causes_from(text: str) -> tuple[str, ...]:
    """Return the effects of `backlash,hard_stop`. Raises ParameterError for unknown, repeated, or none."""
    names = tuple(effect_named(name.strip()).name for name in text.split(",") if name.strip())
    if not names or len(set(names)) < len(names):
        raise ParameterError(f"causes = {text!r}, expected effects of the catalogue, each once")
    return names
