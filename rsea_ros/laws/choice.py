"""The choice among laws on the base model that they join."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, part
from rsea_ros.diagnosis.diagnose import nominal_problem, on_steady_clocks
from rsea_ros.diagnosis.score import Score, score_on
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.fit import fit, with_noise_of
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.start import joint_start
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws import sparse_regression as sparse
from rsea_ros.laws.candidates import TermCandidate, candidates_of, columns_of
from rsea_ros.laws.law import Tried
from rsea_ros.laws.variables import CaseModel, case_model, rows_of
from rsea_ros.model.extent import bound_values
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

FITTED = (*TRAIN, *VALIDATION)


@dataclass(frozen=True)
class Base:
    """A model fitted to all blocks but the test blocks. cases: all samples."""

    solution: Solution
    cases: tuple[Case, ...]

    @property
    def problem(self) -> Problem:
        """The model on all samples."""
        return replace(self.solution.problem, cases=self.cases)

    @property
    def rig(self) -> Rig:
        """The rig with the fitted values."""
        return apply(self.problem.rig, self.problem.unknowns, self.solution.theta)[0]

    @cached_property
    def outputs(self) -> list[dict[str, FloatArray]]:
        """The simulated channels of every case."""
        return self.problem.outputs(self.solution.theta)

    def score(self, sets: tuple[int, ...]) -> Score:
        """Return the score on some sets of blocks."""
        return score_on(self.problem, self.cases, sets, self.outputs, DEFAULT.blocks)

    def levels(self) -> tuple[dict[str, float], dict[str, float]]:
        """Return the RMS of each channel's residual on the test blocks, and its noise."""
        score = self.score(TEST)
        noise = {n: float(np.mean([c.noise[n] for c in self.cases if n in c.noise])) for n in score.sums}
        return {n: score.ratio(n) * noise[n] for n in score.sums}, noise


def fitted_base(records: Sequence[Record], rig: Rig) -> Base:
    """Fit a rig to all blocks of records but the test blocks."""
    rig = rig.with_effects(*(e for e in rig.effects if not e.guess))
    records = [bound_values(with_command(r, rig)) for r in records]
    checked, _ = on_steady_clocks([check(r, rig) for r in records], rig)
    problem = nominal_problem(checked, rig)
    parts = [part(c, FITTED, DEFAULT.blocks) for c in problem.cases]
    start = joint_start(checked[0].record, rig) if rig.loop is not None else None
    solution = fit(parts, rig, start=start)[0]
    whole = replace(solution.problem, cases=problem.cases)
    return Base(solution, with_noise_of(whole.cases, solution, whole.outputs(solution.theta)))


MATTERS = 0.02
"""Smallest gain that is written down: 1 - RMS(with) / RMS(without)."""
_SURE, _SURE_ON_TEST = 4.0, 2.0
"""Standard errors by which a law must gain on the blocks that chose it, and on those that did not."""
_WORSE, _WORSE_ON_TEST = 0.1, 0.25
"""Of what groups gain: what others lose, where the gain counts although few groups have it."""
_SHORT_ENOUGH = 0.75
"""Of what a law without a form explains: a short law that explains less gives way to a learnt curve."""


@dataclass(frozen=True)
class Search:
    """A base model with all columns of laws and their sums of products."""

    base: Base
    cases: tuple[CaseModel, ...]
    candidates: tuple[TermCandidate, ...]
    gram: sparse.Gram


def make_search(base: Base) -> Search:
    """Return a base with the columns of all candidates."""
    problem, theta = base.problem, base.solution.theta
    rows = rows_of(problem, theta)
    cases = tuple(case_model(problem, theta, c, o) for c, o in zip(base.cases, base.outputs, strict=True))
    candidates = candidates_of(cases)
    gram = sparse.gram_of(rows, columns_of(rows, cases, candidates))
    return Search(base, cases, tuple(c for c, _ in candidates), gram)


@dataclass(frozen=True)
class Choice:
    """The models that were compared, those that make the law, and the dependence that a curve shall show."""

    compared: tuple[sparse.SparseLaw, ...]
    taken: tuple[sparse.SparseLaw, ...] = ()
    curve: sparse.Dependence | None = None


def chosen_models(search: Search, depends: Sequence[sparse.Dependence]) -> Choice:
    """Return the models of the law, if one surely helps, with a second place if that surely adds to it."""
    gram = search.gram
    models = sparse.paths(gram, search.candidates)
    none = gram.held_out(np.array([], np.int64))
    if not models:
        return Choice(())
    best = sparse.simplest(models, gram)
    if not surely_helps(gram, none, best.left, best.columns, ()):
        return Choice(tuple(models))
    more = [
        m
        for m in sparse.paths(gram, search.candidates, best.columns, most=3)
        if m.place != best.place or len(best.columns) + len(m.columns) <= sparse.MOST_TERMS
    ]
    second = sparse.simplest([sparse.SparseLaw(best.place, (), best.left), *more], gram)
    helps = second.columns and surely_helps(gram, best.left, second.left, second.columns, best.columns)
    taken = (best, second) if helps else (best,)
    return Choice((*models, *more), taken, _curve(search, depends, none, taken[-1]))


def _curve(
    search: Search, depends: Sequence[sparse.Dependence], none: FloatArray, short: sparse.SparseLaw
) -> sparse.Dependence | None:
    """Return the dependence for a learnt curve, where short laws leave much of it."""
    weight = search.gram.weights(none, sparse.SELECTION)
    room = float(((none - search.gram.count)[sparse.SELECTION] @ weight).sum())
    share = float(((none - short.left)[sparse.SELECTION] @ weight).sum()) / max(room, 1e-9)
    curved = [
        d
        for d in depends
        if any(c.part and (c.place, c.regressor) == (d.place, d.regressor) for c in search.candidates)
    ]
    best = max(curved, key=lambda d: d.share, default=None)
    if best is None or share > _SHORT_ENOUGH * best.share or best.share - share < 2.0 * best.se:
        return None
    return best


def surely_helps(
    gram: sparse.Gram, before: FloatArray, after: FloatArray, columns: Sequence[int], given: Sequence[int]
) -> bool:
    """Return whether columns gain beyond doubt where they were chosen, and on the test blocks too."""
    weight = gram.weights(before, sparse.SELECTION)
    gain = (before - after)[sparse.SELECTION] @ weight
    if not _is_sure(gain, _SURE, _WORSE):
        return False
    both = (np.array(c, np.int64) for c in ([*given], [*given, *columns]))
    held = [gram.loss(c, gram.fit(c, sparse.SELECTION)) @ weight for c in both]
    fall = (held[0] - held[1])[sparse.HELD_BACK]
    rms = 1.0 - float(np.sqrt(held[1][sparse.HELD_BACK].sum() / max(held[0][sparse.HELD_BACK].sum(), 1e-300)))
    return rms > MATTERS and _is_sure(fall, _SURE_ON_TEST, _WORSE_ON_TEST)


def _is_sure(gain: FloatArray, errors: float, worse: float) -> bool:
    """Return whether the gains of groups exceed chance: by their error, or with hardly a loss.

    A feature that appears once, such as a mode passed by a chirp, gains in a single group.
    """
    lost, won = float(-gain[gain < 0.0].sum()), float(gain[gain > 0.0].sum())
    return gain.sum() > 0.0 and bool(gain.sum() > errors * sparse.standard_error(gain) or lost < worse * won)


def summarize_models(search: Search, choice: Choice, taken: Sequence[sparse.SparseLaw]) -> tuple[Tried, ...]:
    """Return the compared models with their held-out residuals over that of the base."""
    gram, first = search.gram, len(search.gram.prior)
    none = gram.held_out(np.array([], np.int64))
    weight = gram.weights(none, sparse.SELECTION)
    whole = float((none[sparse.SELECTION] @ weight).sum())
    rows = []
    for model in choice.compared:
        terms = [search.candidates[k - first].term for k in model.columns]
        share = float((model.left[sparse.SELECTION] @ weight).sum()) / whole
        rows.append(Tried(model.place, tuple(t.name for t in terms if t), float(np.sqrt(max(share, 0.0))),
                          any(model is t for t in taken)))  # fmt: skip
    return tuple(rows)
