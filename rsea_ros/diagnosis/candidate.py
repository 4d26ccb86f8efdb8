"""A candidate: a variant of the problem fitted to the training blocks and scored on the validation blocks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.data_split import TRAIN, VALIDATION, part
from rsea_ros.diagnosis.score import Score, score_on
from rsea_ros.diagnosis.settings import DEFAULT, BlockSettings, DiagnosisSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import sensor_of
from rsea_ros.identification.fit import with_noise_of
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, Solution, serial, solve
from rsea_ros.identification.start import settled_starts
from rsea_ros.identification.unknowns import LOOP_CLOCK, Unknown
from rsea_ros.model.drive import Drive, coarser, finer
from rsea_ros.model.simulation import on_short_steps
from rsea_ros.records.record import FloatArray

_Run = tuple[tuple[Case, ...], list[dict[str, FloatArray]]]


def on_blocks(
    problem: Problem, cases: Sequence[Case], blocks: tuple[int, ...], weights: Score | None,
    rule: BlockSettings,
) -> Problem:  # fmt: skip
    """Return a problem on some blocks of the cases.

    weights: a score of these cases whose misfit counts as noise.
    """
    weighted = cases if weights is None else in_units_of(weights, cases)
    return replace(problem, cases=tuple(part(c, blocks, rule) for c in weighted))


def in_units_of(weights: Score, cases: Sequence[Case]) -> tuple[Case, ...]:
    """Return the cases of a score with each run's residual of a channel as its noise, where it is larger.

    A model that misfits errs more in one run than in another, and not as their sensors' noise does.
    """
    misfits = map(weights.ratios_in, range(len(cases)))
    return tuple(
        replace(case, noise={n: s * max(1.0, misfit.get(n, 1.0)) for n, s in case.noise.items()})
        for case, misfit in zip(cases, misfits, strict=True)
    )


def with_doubled_step(problem: Problem) -> Problem:
    """Return a problem on steps twice as long: half the cost, for models far from the floor."""
    drives = (coarser(c.drive) if isinstance(c.drive, Drive) else c.drive for c in problem.cases)
    return replace(
        problem, cases=tuple(replace(c, drive=d) for c, d in zip(problem.cases, drives, strict=True))
    )


def without_effect(problem: Problem, theta: FloatArray, name: str) -> tuple[Problem, FloatArray]:
    """Return a problem without one of its effects, and theta without its parameters."""
    keep = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    rig = problem.rig.with_effects(*(e for e in problem.rig.effects if e.name != name))
    newest = "" if problem.newest == name else problem.newest
    unknowns = tuple(problem.unknowns[i] for i in keep)
    return replace(problem, rig=rig, unknowns=unknowns, newest=newest), theta[keep]


def without_clocks(problem: Problem, theta: FloatArray) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with all clocks taken as right, but for a loop's own torque.

    Beside a misfit far above the noise the clocks only run to their bounds and lead the search astray.
    """
    keep = [i for i, u in enumerate(problem.unknowns) if not u.is_clock or u.name == LOOP_CLOCK]
    return replace(problem, unknowns=tuple(problem.unknowns[i] for i in keep)), theta[keep]


def with_clocks(problem: Problem, theta: FloatArray, model: Problem) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with the clocks of another problem free again, at zero."""
    clocks = tuple(u for u in model.unknowns if u.is_clock and u.name != LOOP_CLOCK)
    larger = replace(problem, unknowns=(*problem.unknowns, *clocks))
    return larger, np.concatenate([theta, np.zeros(len(clocks))])


def is_apart(effect: Effect, model: Problem) -> bool:
    """Return whether data can tell an effect from those that a model has.

    A delay of all sensors is the command's: where all others are late, the last one cannot be. Beside a
    single sensor the motor's measured torque tells which of the two it is.
    """
    if "late" not in effect.tags:
        return True
    late = {e.sensor for e in map(effect_named, model.acting) if "late" in e.tags}
    sensors = {sensor_of(channel) for case in model.cases for channel in case.measured}
    return bool(sensors - late - {effect.sensor} - ({"motor_torque"} if late else set()))


def with_clocks_in_delay(solution: Solution) -> FloatArray | None:
    """Return theta with what its clocks have in common in the command's delay; None without one.

    Where a delay is a whole number of commands the residual has a kink, and a fit may stop there with the
    rest in the clocks.
    """
    unknowns, acting = solution.problem.unknowns, map(effect_named, solution.problem.acting)
    delays = {f"{e.name}.{e.main.name}" for e in acting if "delay" in e.tags}
    delay = [i for i, u in enumerate(unknowns) if u.name in delays]
    clocks = [i for i, u in enumerate(unknowns) if u.is_clock and not u.is_rate]
    if not delay or not clocks:
        return None
    theta = solution.theta.copy()
    theta[[*clocks, *delay]] -= np.mean(theta[clocks])
    return np.asarray(theta)


@dataclass(frozen=True)
class Candidate:
    """A fitted model with its simulated channels on every case and its score on the validation blocks.

    cases: every sample, with the noise against which the candidate is scored. settings: of its fit.
    """

    solution: Solution
    outputs: list[dict[str, FloatArray]]
    validation: Score
    cases: tuple[Case, ...]
    settings: DiagnosisSettings = DEFAULT

    @property
    def problem(self) -> Problem:
        """The rig with its effects and unknowns."""
        return self.solution.problem

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the effects beside the nominal model, in the order in which they were added."""
        return self.problem.added

    @property
    def newest(self) -> str:
        """Name of the effect that was added last; empty where it was removed, and for the nominal model."""
        return self.problem.newest

    @property
    def size(self) -> int:
        """How many numbers describe the effects; some optional ones do not count."""
        return sum(effect_size(name) for name in self.causes)

    @property
    def parameters(self) -> int:
        """How many unknowns the model has, without shares that only bound the form of a law."""
        free = {
            f"{name}.{p.name}"
            for name in self.problem.acting
            for p in effect_named(name).parameters
            if p.is_share and not p.is_counted
        }
        return sum(u.name not in free for u in self.problem.unknowns)

    @property
    def prior_cost(self) -> float:
        """The cost of leaving the known values."""
        return prior_cost(self.problem, self.solution.theta)

    @property
    def is_at_bound(self) -> bool:
        """Whether the main parameter of the newest effect is at its bound, so that it is not that effect."""
        if not self.newest:
            return False
        main, at = main_of(self.problem, self.solution.theta, self.newest)
        return main.is_near_bound(at, self.settings.acceptance.near_bound)


ITERATIONS = 12
"""Gauss-Newton steps of a fit that begins near its end; twice as many, and one, of one that does not."""
GAIN, LAST_GAIN, _FARTHEST = 2e-4, 1e-6, 20.0
"""Relative fall of the cost, at the noise, below which a fit is done, and one of a model that is tested, far
below the doubt of a parameter; times the noise up to which it grows with the residual, whose small falls mean
nothing far above."""


@dataclass(frozen=True)
class FitSetup:
    """On which samples candidates are fitted, in which units, how far, and by which means.

    weights: a score whose misfit counts as noise. iterations, gain: where a fit ends.
    run: how derivatives are made, one after another or in a pool. is_quick: on steps twice as long.
    """

    cases: tuple[Case, ...]
    settings: DiagnosisSettings
    run: Map = serial
    weights: Score | None = None
    blocks: tuple[int, ...] = TRAIN
    iterations: int = ITERATIONS
    gain: float = GAIN
    is_quick: bool = False

    def mask(self, problem: Problem) -> Problem:
        """Return a problem on the samples and in the units of this setup."""
        masked = on_blocks(problem, self.cases, self.blocks, self.weights, self.settings.blocks)
        return with_doubled_step(masked) if self.is_quick else masked

    def solve(self, problem: Problem, theta: FloatArray | None, matrix: FloatArray | None = None) -> Solution:
        """Fit the unknowns of a masked problem. matrix: derivatives to begin with."""
        ratios = [] if self.weights is None else [self.weights.ratio(n) for n in self.weights.sums]
        gain = self.gain * min(max([1.0, *ratios]), _FARTHEST)  # worst channel's RMS over the noise
        return solve(problem, theta, iterations=self.iterations, gain=gain, run=self.run, matrix=matrix)


def fit_candidate(
    setup: FitSetup, problem: Problem, theta: FloatArray | None = None, near: Solution | None = None
) -> Candidate:
    """Fit a problem's unknowns and score the result.

    near: a solution on the same blocks, with other noise, whose derivatives the fit begins with.
    """
    masked = setup.mask(problem)
    solution = setup.solve(masked, theta, None if near is None else _reweight(near, masked))
    moved = with_clocks_in_delay(solution)
    if moved is not None:
        solution = min(solution, setup.solve(masked, moved), key=lambda s: s.cost)
    outputs = solution.problem.outputs(solution.theta)
    validation = score_on(solution.problem, setup.cases, VALIDATION, outputs, setup.settings.blocks)
    return Candidate(solution, outputs, validation, setup.cases, setup.settings)


def refit(model: Candidate, setup: FitSetup) -> Candidate:
    """Fit a candidate again with each channel in units of its residual."""
    setup = replace(setup, cases=model.cases, weights=model.validation)
    return fit_candidate(setup, model.problem, model.solution.theta, near=model.solution)


def on_fine_steps(model: Candidate, setup: FitSetup) -> Candidate:
    """Return a candidate `on_short_steps`; itself if its own are short, or a loop samples as it steps."""
    if model.problem.rig.loop is not None:
        return model

    def halve(run: _Run) -> _Run:
        halved = tuple(replace(c, drive=finer(c.drive)) if isinstance(c.drive, Drive) else c for c in run[0])
        return halved, replace(model.problem, cases=halved).outputs(model.solution.theta)

    cases, outputs = on_short_steps((model.cases, model.outputs), halve, _change)
    return model if cases is model.cases else refit(rescore(replace(model, outputs=outputs), cases), setup)


def where_it_begins(model: Candidate, setup: FitSetup) -> Candidate:
    """Return a candidate whose drives begin anew, behind gaps, where it has them; itself without gaps."""
    whole = replace(model.problem, cases=model.cases)
    settled, theta = settled_starts(whole, model.solution.theta, setup.run)
    if settled is whole:
        return model
    return refit(rescore(replace(model, outputs=settled.outputs(theta)), settled.cases), setup)


def _change(before: _Run, after: _Run) -> float:
    """Return the RMS change of outputs over the noise, in the worst channel of a case."""
    runs = zip(*before, after[1], strict=True)
    return max(
        float(np.sqrt(np.mean((a[n] - b[n])[c.mask[n]] ** 2))) / c.noise[n]
        for c, b, a in runs for n in c.noise if n in b and c.mask[n].any()
    )  # fmt: skip


def with_noise_reestimated(model: Candidate) -> Candidate:
    """Return a candidate with the noise that its own residual shows, scored against that."""
    return rescore(model, with_noise_of(model.cases, model.solution, model.outputs))


def rescore(model: Candidate, cases: tuple[Case, ...]) -> Candidate:
    """Return a candidate with its score against the noise of other cases of the same records."""
    validation = score_on(model.problem, cases, VALIDATION, model.outputs, model.settings.blocks)
    return replace(model, cases=cases, validation=validation)


def leaves_only_noise(model: Candidate, limit: float) -> bool:
    """Return whether the residual of every channel is noise, on all blocks but the test blocks.

    limit: RMS of the residual over the noise, below which it is.
    """
    blocks = (*TRAIN, *VALIDATION)
    score = score_on(model.problem, model.cases, blocks, model.outputs, model.settings.blocks)
    return score.missed == 0.0 and all(score.ratio(n) < limit for n in score.sums)


def effect_size(name: str) -> int:
    """Return how many numbers describe an effect; some optional ones do not count."""
    return sum(p.is_counted for p in effect_named(name).parameters)


def prior_cost(problem: Problem, theta: FloatArray) -> float:
    """Return the cost of leaving the known values: their sigmas, squared."""
    return float(sum(u.sigmas(float(t)) ** 2 for t, u in zip(theta, problem.unknowns, strict=True)))


def main_of(problem: Problem, theta: FloatArray, name: str) -> tuple[Unknown, float]:
    """Return the unknown that is an effect's main parameter, and where theta has it."""
    main = f"{name}.{effect_named(name).main.name}"
    return next((u, float(t)) for u, t in zip(problem.unknowns, theta, strict=True) if u.name == main)


def _reweight(solution: Solution, problem: Problem) -> FloatArray:
    """Return the derivatives of a solution in units of the noise of another problem on the same samples."""
    new, old = (p.by_row(lambda case, n: case.noise[n]) for p in (problem, solution.problem))
    return solution.jacobian * (old / new)[:, None]
