"""Causes weighed jointly over all runs: each fitted from the prior of the runs before, by its evidence.

The logarithm of the evidence is Laplace's, with priors on the rig's values and on the cause's size:

    ln p(data | cause) = -C / (2 k) - (ln det(J'J / k + L) - ln det L) / 2

C: cost of the fit, prior included; L: the prior's information; k: the variance that the best fit leaves, in
units of the noise, not below 1. Of minima of about the same cost the one of the largest evidence counts: a
narrow one that fits a little better is less likely than a wide one. (MacKay, Neural Computation 4, 1992.)

A cause that the data cannot show weighs as much as no cause: it stays possible until a run could have shown
it. All causes have the same prior probability.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.effects.effect import Parameter
from rsea_ros.effects.guess import Guess
from rsea_ros.errors import ParameterError
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis, may_contain, shared_parameters
from rsea_ros.identification.fit import unknowns_of
from rsea_ros.identification.problem import Case, Problem, case_from
from rsea_ros.identification.solver import Map, Solution, power, serial, solve
from rsea_ros.identification.unknowns import Unknown, idle, start_vector, unknowns_of_effect
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.records.record import MEASURED, BoolArray, FloatArray, Record

_SIZES = 1.0
"""One sigma of the size of a cause around none at all, in what its catalogue calls typical."""
_SPAN = 0.25
"""One sigma of another parameter of a cause around its typical value, of the width of its bounds."""


def problem_of(name: str, rig: Rig, cases: Sequence[Case]) -> Problem:
    """Return the problem of a rig with one more cause, or none."""
    nominal = unknowns_of(rig, cases)
    stated = frozenset(e.name for e in rig.effects)
    if name == NOTHING:
        return Problem(tuple(cases), rig, nominal, MEASURED, stated=stated)
    effect = effect_named(name)
    with_it = rig.with_effects(*rig.effects, EffectSetting(name, effect.complete(effect.null)))
    free = unknowns_of_effect(effect, effect.typical, rig.known | idle(effect, rig))
    parameters = {f"{name}.{p.name}": p for p in effect.parameters}
    doubted = tuple(_with_prior(u, parameters[u.name], u.name == f"{name}.{effect.main.name}") for u in free)
    return Problem(tuple(cases), with_it, (*nominal, *doubted), MEASURED, stated=stated)


def _with_prior(unknown: Unknown, parameter: Parameter, is_size: bool) -> Unknown:
    """Return an unknown of a cause with a prior: its size around null, the rest around typical values."""
    typical, null = unknown.inner(parameter.typical), unknown.start
    if is_size and (parameter.null > 0.0 or not parameter.logarithmic) and math.isfinite(parameter.null):
        null = unknown.inner(parameter.null)
        return replace(unknown, start=parameter.null, doubt=_SIZES * abs(typical - null) or unknown.reach)
    if math.isfinite(parameter.spread):
        return unknown
    return replace(unknown, doubt=_SPAN * _width(unknown, parameter))


def _width(unknown: Unknown, parameter: Parameter) -> float:
    """Return how far the parameter can reach in the fit's coordinate; 16 times where it has no bound."""
    ends = (parameter.low, parameter.high)
    if (unknown.logarithmic and parameter.low <= 0.0) or not all(map(math.isfinite, ends)):
        return math.log(16.0) if unknown.logarithmic else 16.0 * abs(parameter.typical or 1.0)
    width = unknown.inner(parameter.high) - unknown.inner(parameter.low)
    return min(width, 16.0 * unknown.scale)


def vector_at(problem: Problem, near: Mapping[str, float], start: Mapping[str, float]) -> FloatArray:
    """Return coordinates of a problem: `start` where it says, else `near` (coordinates), else its prior."""

    def coordinate(u: Unknown) -> float:
        if u.name in start:
            return u.inner(min(max(start[u.name], u.low), u.high))
        return near.get(u.name, u.inner(u.start))

    return np.array([coordinate(u) for u in problem.unknowns])


def weights_of(problem: Problem) -> FloatArray:
    """Return the information of the prior, shape (n,)."""
    return np.array([1.0 / u.reach**2 for u in problem.unknowns])


_SHARE = 0.15
"""Of a cause's typical size, where fits begin too."""
_LITTLE = 4.0
"""Cost above the least, up to which a fit counts as no worse."""
_CLOSE = 1.5
"""Times the least cost, up to which a fit is begun once more."""
_GAIN, _ITERATIONS = 1e-4, 12
"""Relative fall of the cost below which a fit ends, and its most steps."""


def fit_cause(
    name: str, problem: Problem, before: FloatArray | None, near: Mapping[str, float], run: Map
) -> Solution:
    """Return a cause fitted from the best of its guesses, and from where it was or the rig's own fit."""
    guesses = [{}] if name == NOTHING else [*effect_named(name).default_guesses, *_smaller(name)]
    named = [{f"{name}.{k}": v for k, v in guess.items()} for guess in guesses]
    rows = [vector_at(problem, {}, guess) for guess in named]
    others = [before] if before is not None else [vector_at(problem, near, g) for g in named if near]
    starts = [_best(problem, group, run) for group in (rows, others) if group]
    fits = [solve(problem, theta, iterations=_ITERATIONS, gain=_GAIN, run=run) for theta in starts]
    return min(fits, key=lambda s: s.cost)


def _smaller(name: str) -> list[Guess]:
    """Return guesses of a cause with a share of its typical size: a minimum may lie nearer to none at all."""
    main, guesses = effect_named(name).main, effect_named(name).default_guesses
    if not math.isfinite(main.null) or (main.logarithmic and main.null <= 0.0):
        return []
    return [{**g, main.name: main.null + _SHARE * (g[main.name] - main.null)} for g in guesses]


def repeat_fits(fits: Mapping[str, Solution], run: Map) -> dict[str, Solution]:
    """Return the fits, those that are close to the best also begun where others ended.

    A fit that began far from the final values of the rig may stop in a local minimum: one that is worse than
    the best begins once more from the rig's values of the best. A cause that contains another may miss it:
    it begins once more from the other, where that fits no worse than the best.
    """
    best, scale = min(fits.values(), key=lambda s: s.cost), scale_of(fits)
    good = {n: f for n, f in fits.items() if n != NOTHING and f.cost < best.cost + _LITTLE}
    rig = {u.name: float(v) for u, v in zip(best.problem.unknowns, best.theta, strict=True)}
    again = dict(fits)
    for name, fit in fits.items():
        if name == NOTHING or fit.cost >= _CLOSE * best.cost:
            continue
        starts = [x for n, f in good.items() for x in _as_simpler(name, fit.problem, n, f)]
        if fit.cost > best.cost + _LITTLE:
            pairs = zip(fit.problem.unknowns, fit.theta, strict=True)
            starts.append(np.array([rig.get(u.name, float(v)) for u, v in pairs]))
        tried = [solve(fit.problem, x, iterations=_ITERATIONS, gain=_GAIN, run=run) for x in starts]
        least = min(s.cost for s in (fit, *tried))
        no_worse = [s for s in (fit, *tried) if s.cost <= least + _LITTLE]
        again[name] = max(no_worse, key=lambda s: log_evidence(s, scale))
    return again


def scale_of(fits: Mapping[str, Solution]) -> float:
    """Return the variance that the best fit leaves, in units of the noise, not below 1."""
    samples = max(len(next(iter(fits.values())).residual), 1)
    return max(1.0, min(s.cost for s in fits.values()) / samples)


def information_of(solution: Solution, scale: float) -> FloatArray:
    """Return the information of prior and data together, shape (n, n)."""
    matrix = solution.jacobian
    return np.asarray(matrix.T @ matrix / scale + np.diag(weights_of(solution.problem)))


def log_evidence(solution: Solution, scale: float) -> float:
    """Return the logarithm of the evidence of a fit; see the module docstring. scale: k."""
    known = weights_of(solution.problem)
    spread = np.linalg.slogdet(information_of(solution, scale) / np.sqrt(np.outer(known, known)))[1]
    return -0.5 * solution.cost / scale - 0.5 * float(spread)


def _as_simpler(name: str, problem: Problem, simpler: str, fit: Solution) -> list[FloatArray]:
    """Return the start at which a cause does only what the fit of a simpler one does; none if it cannot."""
    if not may_contain(name, simpler):
        return []
    absent = {f"{name}.{p.name}": p.null for p in effect_named(name).parameters if math.isfinite(p.null)}
    same = {f"{name}.{p}": fit.values[f"{simpler}.{s}"] for p, s in shared_parameters(name, simpler).items()}
    return [vector_at(problem, {}, fit.values | absent | same)]


def _best(problem: Problem, thetas: Sequence[FloatArray], run: Map) -> FloatArray:
    """Return the start of the least cost; fits that begin far off may end in a local minimum."""
    if len(thetas) == 1:
        return thetas[0]
    costs = run(lambda k: np.array([_cost(problem, thetas[k])]), range(len(thetas)))
    return thetas[int(np.argmin([float(c[0]) for c in costs]))]


def _cost(problem: Problem, theta: FloatArray) -> float:
    away = theta - start_vector(problem.unknowns)
    return power(problem.residual(theta)) + float(weights_of(problem) @ away**2)


HOPELESS = 1e-6
"""Probability below which a cause is not fitted again to further records."""


@dataclass(frozen=True)
class RunWeighing:
    """The result from all records. probability: by cause, for those not dropped before; they sum to 1."""

    cases: tuple[Case, ...]
    fits: Mapping[str, Solution]
    probability: Mapping[str, float]
    scale: float

    @property
    def best(self) -> str:
        """The most likely cause."""
        return max(self.probability, key=lambda n: self.probability[n])

    @property
    def left(self) -> float:
        """RMS over the noise that the best cause leaves."""
        return self.fits[self.best].rms

    def near_by_data(self, least: float, *, richer: bool = False) -> list[str]:
        """Return the causes of no more parameters than the best that fit less than `least` worse, in S.

        By the data alone, without their priors. richer: those of more parameters. A cause that contains the
        best always fits as well: what it adds may be absent, or not shown so far.
        """
        fits = dict(self.fits)
        best = fits.pop(self.best)
        most = power(best.residual) + least * self.scale
        as_well = [n for n, s in fits.items() if power(s.residual) < most]
        return [n for n in as_well if (len(fits[n].theta) > len(best.theta)) == richer]

    def hypotheses(self, least: float = 0.0) -> list[Hypothesis]:
        """Return the causes with a probability of at least `least`, the likeliest first."""
        names = sorted(self.probability, key=lambda n: -self.probability[n])
        return [self._hypothesis(n) for n in names if self.probability[n] >= least]

    def _hypothesis(self, name: str) -> Hypothesis:
        solution = self.fits[name]
        information = information_of(solution, self.scale)
        problem = replace(solution.problem, cases=())
        hypothesis = Hypothesis(name, problem, solution.theta, information, self.probability[name])
        return hypothesis.beside(self.best)


def cases_of(records: Sequence[Record], rig: Rig) -> tuple[Case, ...]:
    """Return records ready to be fitted, faulty samples masked; a value that repeats counts once.

    In slow motion an encoder rounds many samples in a row to one count, by the same error: they are one
    observation, and taken as many they would turn the rounding of a turning point into physics.
    """
    checked = [check(record, rig) for record in records]
    cases = [case_from(c.record, rig, c.masked) for c in checked]
    return tuple(c.within({n: middles_of_runs(y) for n, y in c.measured.items()}) for c in cases)


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
    ended = {n: fit.theta for n, fit in before.fits.items()} if before is not None else {}
    nominal = fit_cause(NOTHING, problem_of(NOTHING, rig, cases), ended.get(NOTHING), {}, run)
    near = dict(zip((u.name for u in nominal.problem.unknowns), nominal.theta, strict=True))
    solutions = {NOTHING: nominal}
    for name in (n for n in names if n != NOTHING):
        solutions[name] = fit_cause(name, problem_of(name, rig, cases), ended.get(name), near, run)
    fits = repeat_fits(solutions, run)
    scale = scale_of(fits)
    logs = np.array([log_evidence(fit, scale) for fit in fits.values()])
    shares = np.exp(logs - logs.max())
    return RunWeighing(cases, fits, dict(zip(fits, (shares / shares.sum()).tolist(), strict=True)), scale)


SHORTEST = 4.2
"""s of a record, rest included, that the diagnosis takes."""


def diagnose_together(
    records: Sequence[Record], rig: Rig, causes: Sequence[str]
) -> Diagnosis:
    """Return the diagnosis of all records together, which weighs causes by held-out data."""
    others = tuple(name for name in catalogue() if name not in causes)
    return diagnose(list(records), rig, settings=DiagnosisSettings(without=others))


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
