"""The search for a law: what is missing, what it depends on, the shortest law of it, and its gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, part
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.score import RESAMPLES, Score, score_on
from rsea_ros.diagnosis.verdict import is_at_floor
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.identify import fit
from rsea_ros.identification.joint_start import joint_start
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.steady import steadied
from rsea_ros.identification.threads import one_blas_thread
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.assembly import curve_of, law_of
from rsea_ros.laws.candidates import Candidate, candidates_of, columns_of
from rsea_ros.laws.columns import Bench, bench_of, rows_of
from rsea_ros.laws.dependence import Dependence, dependences
from rsea_ros.laws.file import Draft, finished
from rsea_ros.laws.gram import HELD_BACK, SELECTION, Gram, gram_of
from rsea_ros.laws.law import Law
from rsea_ros.laws.refinement import Refined, acting, effect_from, refine
from rsea_ros.laws.result import LawResult, Tried, WrittenLaw
from rsea_ros.laws.selection import MOST_TERMS, Model, paths, simplest, standard_error
from rsea_ros.laws.writing import Provenance
from rsea_ros.model.extent import bounded
from rsea_ros.model.position_loop import commanded
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.progress import Progress
from rsea_ros.signals import FloatArray, Record

_SURE, _SURE_ON_TEST = 4.0, 2.0
"""Standard errors by which a law must gain on the blocks that chose it, and on those that did not."""
_WORSE, _WORSE_ON_TEST = 0.1, 0.25
"""Of what groups gain: what others lose, where the gain counts although few groups have it."""
_MATTERS = 0.02
"""Smallest gain that is written down: 1 - RMS(with) / RMS(without)."""
_SHORT_ENOUGH = 0.75
"""Of what a law without a form explains: a short law that explains less gives way to a learnt curve."""

_NEEDED = 0.03
"""Of what is left: a term without which the fit leaves no more than that is left out."""
FITTED = (*TRAIN, *VALIDATION)


@dataclass(frozen=True)
class Base:
    """The model whose residual is looked at, fitted to all blocks but the test blocks. cases: all samples."""

    solution: Solution
    cases: tuple[Case, ...]
    outputs: list[dict[str, FloatArray]]

    @property
    def problem(self) -> Problem:
        """The base model on all samples."""
        return replace(self.solution.problem, cases=self.cases)

    def score(self, sets: tuple[int, ...]) -> Score:
        """Return the base's score on some sets of blocks."""
        return score_on(self.problem, self.cases, sets, self.outputs)


@dataclass(frozen=True)
class Search:
    """A base model with all columns of laws and their sums of products."""

    base: Base
    benches: tuple[Bench, ...]
    candidates: tuple[Candidate, ...]
    gram: Gram


def learn(
    records: Sequence[Record],
    rig: Rig,
    provenance: Provenance | None = None,
    progress: Progress | None = None,
) -> LawResult:
    """Return what is missing in a rig's simulation of records, as laws with their effect files.

    Raises IdentificationError when the records are too short or do not hold what the rig needs.
    """
    tell = progress or (lambda step, share: None)
    with one_blas_thread():
        tell("fitting the model", 0.0)
        base = fitted_base(records, rig)
        if is_at_floor(base.score(TEST)):
            return nothing_left(base, records)
        tell("looking for what is missing", 0.2)
        search = searched(base)
        tell("comparing laws", 0.6)
        depends = dependences(search.gram, search.candidates)
        models = chosen_models(search, depends)
        taken = [k for m in models.taken for k in m.columns]
        depends = dependences(search.gram, search.candidates, taken) if taken else depends
        tell("fitting the law in the simulation", 0.75)
        return _result(search, depends, models, records, provenance)


def fitted_base(records: Sequence[Record], rig: Rig) -> Base:
    """Fit a rig to all blocks of records but the test blocks."""
    rig = rig.with_effects(*(e for e in rig.effects if not e.guess))
    records = [bounded(commanded(r, rig)) for r in records]
    checked = [check(r, rig) for r in records]
    steady = steadied([c.record for c in checked], [c.masked for c in checked], rig)
    checked = [replace(c, record=r) for c, r in zip(checked, steady.records, strict=True)]
    problem = nominal_problem(checked, rig)
    parts = [part(c, FITTED) for c in problem.cases]
    start = joint_start(checked[0].record, rig) if rig.loop is not None else None
    solution, known, _ = fit(parts, rig, start=start)
    cases = tuple(replace(c, noise=_finer(c, k)) for c, k in zip(problem.cases, known, strict=True))
    return Base(solution, cases, replace(solution.problem, cases=cases).outputs(solution.theta))


def _finer(case: Case, known: Case) -> dict[str, float]:
    """Return the noise of each channel: what a fit takes for noise may be a misfit."""
    return {n: min(v, known.noise[n]) for n, v in case.noise.items()}


def nothing_left(base: Base, records: Sequence[Record]) -> LawResult:
    """Return the result where the base model is at the noise floor."""
    before, noise = _levels(base.problem, base.outputs, base.cases)
    rig = apply(base.problem.rig, base.problem.unknowns, base.solution.theta)[0]
    duration = sum(c.duration for c in base.cases)
    return LawResult(rig.name, tuple(r.source for r in records), duration, rig, rig,
                     (), (), (), 0.0, (0.0, 0.0), 0.0, before, before, noise, at_floor=True)  # fmt: skip


def searched(base: Base) -> Search:
    """Return a base with the columns of all candidates."""
    problem, theta = base.problem, base.solution.theta
    rows = rows_of(problem, theta)
    benches = tuple(bench_of(problem, theta, c, o) for c, o in zip(base.cases, base.outputs, strict=True))
    made = candidates_of(benches)
    gram = gram_of(rows, columns_of(rows, benches, made))
    return Search(base, benches, tuple(c for c, _ in made), gram)


@dataclass(frozen=True)
class Choice:
    """The models that were compared, those that make the law, and the dependence that a curve shall show."""

    compared: tuple[Model, ...]
    taken: tuple[Model, ...] = ()
    curve: Dependence | None = None


def chosen_models(search: Search, depends: Sequence[Dependence]) -> Choice:
    """Return the models of the law, if any surely helps; a second place where that surely adds."""
    gram = search.gram
    models = paths(gram, search.candidates)
    none = gram.held_out(np.array([], np.int64))
    if not models:
        return Choice(())
    best = simplest(models, gram)
    if not surely_helps(gram, none, best.left, best.columns, ()):
        return Choice(tuple(models))
    more = [
        m
        for m in paths(gram, search.candidates, best.columns, most=3)
        if m.place != best.place or len(best.columns) + len(m.columns) <= MOST_TERMS
    ]
    second = simplest([Model(best.place, (), best.left), *more], gram)
    helps = second.columns and surely_helps(gram, best.left, second.left, second.columns, best.columns)
    taken = (best, second) if helps else (best,)
    return Choice((*models, *more), taken, _curve(search, depends, none, taken[-1]))


def _curve(
    search: Search, depends: Sequence[Dependence], none: FloatArray, short: Model
) -> Dependence | None:
    """Return the dependence that a learnt curve shall show, where short laws leave much of it."""
    weight = search.gram.weights(none, SELECTION)
    room = float(((none - search.gram.count)[SELECTION] @ weight).sum())
    share = float(((none - short.left)[SELECTION] @ weight).sum()) / max(room, 1e-9)
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
    gram: Gram, before: FloatArray, after: FloatArray, columns: Sequence[int], given: Sequence[int]
) -> bool:
    """Tell whether columns gain beyond doubt where they were chosen, and on the test blocks too."""
    weight = gram.weights(before, SELECTION)
    gain = (before - after)[SELECTION] @ weight
    if not _is_sure(gain, _SURE, _WORSE):
        return False
    held = [gram.tested(np.array(c, np.int64)) @ weight for c in ([*given], [*given, *columns])]
    fall = (held[0] - held[1])[HELD_BACK]
    rms = 1.0 - float(np.sqrt(held[1][HELD_BACK].sum() / max(held[0][HELD_BACK].sum(), 1e-300)))
    return rms > _MATTERS and _is_sure(fall, _SURE_ON_TEST, _WORSE_ON_TEST)


def _is_sure(gain: FloatArray, errors: float, worse: float) -> bool:
    """Tell whether the gains of groups are more than chance: beyond their error, or hardly any is a loss.

    What an excitation shows once, such as a mode that a chirp passes, gains in one group alone.
    """
    lost, won = float(-gain[gain < 0.0].sum()), float(gain[gain > 0.0].sum())
    return gain.sum() > 0.0 and bool(gain.sum() > errors * standard_error(gain) or lost < worse * won)


def _result(
    search: Search, depends: Sequence[Dependence], choice: Choice, records: Sequence[Record],
    provenance: Provenance | None,
) -> LawResult:  # fmt: skip
    base = search.base
    laws = _laws(search, choice)
    drafts = [Draft(law, effect_from(Draft.source(law), law.name)) for law in laws]
    with acting([d.effect for d in drafts]):
        refined = _refined(base, drafts) if drafts else None
        if refined is None or _gain(base, refined)[0] < _MATTERS:
            return replace(nothing_left(base, records), dependences=tuple(depends), at_floor=False,
                           tried=_tried(search, choice, ()))  # fmt: skip
        gain, ci95 = _gain(base, refined)
        before, noise = _levels(base.problem, base.outputs, base.cases)
        problem = replace(refined.solution.problem, cases=base.cases)
        after = _levels(problem, problem.outputs(refined.solution.theta), base.cases)[0]
        share = _share(before, after, noise)
        written = finished(drafts, refined, base.cases, provenance, gain, ci95)
        rigs = [
            apply(s.problem.rig, s.problem.unknowns, s.theta)[0] for s in (base.solution, refined.solution)
        ]
    return LawResult(
        rig_name=rigs[0].name, sources=tuple(r.source for r in records),
        duration=sum(c.duration for c in base.cases), base_rig=rigs[0],
        rig=_with_files(rigs[1], rigs[0], written),
        dependences=tuple(depends), tried=_tried(search, choice, choice.taken), laws=tuple(written),
        gain=gain, gain_ci95=ci95, share=share, before=before, after=after, noise=noise, at_floor=False,
    )  # fmt: skip


def _with_files(rig: Rig, base: Rig, written: Sequence[WrittenLaw]) -> Rig:
    """Return a rig with the effects of the base and the laws that have files, with their parameters."""
    acting = {e.name for e in base.effects}
    laws = (EffectSetting(w.law.name, w.law.parameters) for w in written)
    return rig.with_effects(*(e for e in rig.effects if e.name in acting), *laws)


def _laws(search: Search, choice: Choice) -> list[Law]:
    if choice.curve is not None:
        return [curve_of(search.gram, search.candidates, search.benches, choice.curve)]
    return law_of(search.gram, search.candidates, search.benches, choice.taken)


def _refined(base: Base, drafts: Sequence[Draft]) -> Refined:
    """Fit the laws in the simulation, in units of what they leave, without terms that it does not need."""
    refined = refine(base.solution, base.cases, base.score(FITTED), _starts(drafts, None))
    weights = _score(base, refined, FITTED)
    refined = _again(base, drafts, refined, weights, frozenset())
    held: frozenset[str] = frozenset()
    while (names := _least(drafts, refined, held)) is not None:
        fewer = _again(base, drafts, refined, weights, held | names)
        if fewer.solution.cost > (1.0 + _NEEDED) * refined.solution.cost:
            break
        refined, held = fewer, held | names
    return refined


def _starts(drafts: Sequence[Draft], refined: Refined | None) -> list[tuple[Effect, dict[str, float]]]:
    if refined is None:
        return [(d.effect, d.law.parameters) for d in drafts]
    return [(d.effect, refined.parameters(d.effect.name)) for d in drafts]


def _again(
    base: Base, drafts: Sequence[Draft], refined: Refined, weights: Score, held: frozenset[str]
) -> Refined:
    """Fit from a fit on, with some parameters held: coefficients at zero, shapes where they are."""
    nearer = replace(base.solution, theta=refined.solution.theta[: len(base.solution.theta)])
    starts = [
        (e, {n: 0.0 if f"{e.name}.{n}" in held and _is_size(d, n) else v for n, v in values.items()})
        for d, (e, values) in zip(drafts, _starts(drafts, refined), strict=True)
    ]
    return refine(nearer, base.cases, weights, starts, held)


def _is_size(draft: Draft, name: str) -> bool:
    return name in {c for c, _ in draft.law.names}


def _least(drafts: Sequence[Draft], refined: Refined, held: frozenset[str]) -> frozenset[str] | None:
    """Return the parameters of the term of least significance, its shape too where no other has it."""
    terms = [
        (d.effect.name, c, s) for d in drafts for c, s in d.law.names if f"{d.effect.name}.{c}" not in held
    ]
    if len(terms) < 2:
        return None

    def significance(term: tuple[str, str, str]) -> float:
        name = f"{term[0]}.{term[1]}"
        low, high = refined.ci95[name]
        return abs(refined.solution.values[name]) / max(high - low, 1e-300)

    effect, c, s = min(terms, key=significance)
    shared = any(other != c and shape == s for e, other, shape in terms if e == effect)
    return frozenset({f"{effect}.{c}", *([f"{effect}.{s}"] if s and not shared else [])})


def _score(base: Base, refined: Refined, sets: tuple[int, ...]) -> Score:
    """Return the score of refined laws on some sets of blocks."""
    problem = replace(refined.solution.problem, cases=base.cases)
    return score_on(problem, base.cases, sets, problem.outputs(refined.solution.theta))


def _gain(base: Base, refined: Refined) -> tuple[float, tuple[float, float]]:
    """Return the gain on the test blocks with its interval."""
    return gain_of(base.score(TEST), _score(base, refined, TEST))


def gain_of(without: Score, with_it: Score) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(with) / RMS(without) of all channels together, and its 95 % bootstrap interval."""
    a, b = with_it.loss(without), without.loss(without)
    draws = np.random.default_rng(0).integers(0, len(a), (RESAMPLES, len(a)))
    resampled = 1.0 - np.sqrt(a[draws].sum(axis=1) / np.maximum(b[draws].sum(axis=1), 1e-300))
    low, high = np.quantile(resampled, [0.025, 0.975])
    return 1.0 - float(np.sqrt(a.sum() / max(b.sum(), 1e-300))), (float(low), float(high))


def _levels(
    problem: Problem, outputs: Sequence[dict[str, FloatArray]], cases: Sequence[Case]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the RMS of each channel's residual on the test blocks, and its noise."""
    score = score_on(problem, cases, TEST, list(outputs))
    noise = {n: float(np.mean([c.noise[n] for c in cases if n in c.noise])) for n in score.sums}
    return {n: score.ratio(n) * noise[n] for n in score.sums}, noise


def _share(before: dict[str, float], after: dict[str, float], noise: dict[str, float]) -> float:
    """Return which share of the power above the noise is explained, of the channels that had any."""
    shares = [
        ((before[n] ** 2 - after[n] ** 2), before[n] ** 2 - noise[n] ** 2)
        for n in before
        if before[n] > 1.1 * noise[n]
    ]
    return sum(a / b for a, b in shares) / len(shares) if shares else 0.0


def _tried(search: Search, choice: Choice, taken: Sequence[Model]) -> tuple[Tried, ...]:
    """Return the compared models with what each leaves, held out, over what the base leaves."""
    gram, first = search.gram, len(search.gram.prior)
    none = gram.held_out(np.array([], np.int64))
    weight = gram.weights(none, SELECTION)
    whole = float((none[SELECTION] @ weight).sum())
    rows = []
    for model in choice.compared:
        terms = [search.candidates[k - first].term for k in model.columns]
        left = float((model.left[SELECTION] @ weight).sum()) / whole
        rows.append(Tried(model.place, tuple(t.name for t in terms if t), float(np.sqrt(max(left, 0.0))),
                          any(model is t for t in taken)))  # fmt: skip
    return tuple(rows)
