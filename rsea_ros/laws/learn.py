"""A law learnt from a record: columns, regression, choice, and its fit in the simulation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.score import Score, gain_of as gain_of_blocks
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import lend
from rsea_ros.identification.solver import one_blas_thread
from rsea_ros.laws import choice as choices
from rsea_ros.laws.candidates import SPLINES, basis_of, spline_knots
from rsea_ros.laws.effect_source import LawProvenance
from rsea_ros.laws.file import Draft, Refined, draft_of, finish_laws, refine
from rsea_ros.laws.law import FittedTerm, Law, LawResult, LearntCurve, ranges_of
from rsea_ros.laws.sparse_regression import SELECTION, Dependence, SparseLaw, dependences
from rsea_ros.laws.variables import CaseModel
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

_NEEDED = 0.03
"""Of what is left: a term without which the fit leaves no more than that is left out."""


def refined_laws(base: choices.Base, drafts: Sequence[Draft]) -> Refined:
    """Fit the laws in the simulation, in units of their residual, and drop needless terms."""
    starts = [(d.effect, d.law.parameters) for d in drafts]
    refined = refine(base, base.score(choices.FITTED), starts)
    weights = refined.score(choices.FITTED)
    refined = _again(base, drafts, refined, weights, frozenset())
    held: frozenset[str] = frozenset()
    while (names := _least(drafts, refined, held)) is not None:
        fewer = _again(base, drafts, refined, weights, held | names)
        if fewer.solution.cost > (1.0 + _NEEDED) * refined.solution.cost:
            break
        refined, held = fewer, held | names
    return refined


def _again(
    base: choices.Base, drafts: Sequence[Draft], refined: Refined, weights: Score, held: frozenset[str]
) -> Refined:
    """Fit from a fit on, with some parameters held: coefficients at zero, shapes where they are."""
    nearer = replace(base.solution, theta=refined.solution.theta[: len(base.solution.theta)])
    base = replace(base, solution=nearer)
    starts = [
        (e, refined.parameters(e.name) | {n: 0.0 for n, _ in law.names if f"{e.name}.{n}" in held})
        for e, law in ((d.effect, d.law) for d in drafts)
    ]
    return refine(base, weights, starts, held)


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


def gain_of(without: Score, with_it: Score) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(with) / RMS(without) of all channels together, and its 95 % bootstrap interval."""
    return gain_of_blocks(with_it.loss(without), without.loss(without))


def share_of(before: dict[str, float], after: dict[str, float], noise: dict[str, float]) -> float:
    """Return the explained share of the power above the noise, over the channels that had any."""
    shares = [
        ((before[n] ** 2 - after[n] ** 2), before[n] ** 2 - noise[n] ** 2)
        for n in before
        if before[n] > DEFAULT.floor.reached * noise[n]
    ]
    return sum(a / b for a, b in shares) / len(shares) if shares else 0.0


_POINTS = 41
"""Of a learnt curve, evenly apart."""
_RIDGE = 1e-4


def law_of(search: choices.Search, models: Sequence[SparseLaw]) -> list[Law]:
    """Return the laws of some models fitted together, those of one place as one."""
    gram, candidates, first = search.gram, search.candidates, len(search.gram.prior)
    columns = [k for m in models for k in m.columns]
    if not columns:
        return []
    beta = gram.fit(np.array(columns, np.int64), SELECTION)[first:]
    parts: dict[str, list[FittedTerm]] = {}
    for k, b in zip(columns, beta, strict=True):
        candidate = candidates[k - first]
        assert candidate.term is not None
        parts.setdefault(candidate.place, []).append(
            FittedTerm(candidate.term, float(b / gram.scale[k]), candidate.shape)
        )
    laws = []
    for place, items in parts.items():
        regressor = list_names(list(dict.fromkeys(p.term.regressor for p in items)))
        name = _name_with_place(f"law_of_{_slug(items[0].term.regressor)}", place)
        laws.append(_with_ranges(Law(name, items[0].term.place, regressor, tuple(items), {}), search.cases))
    return laws


def curve_of(search: choices.Search, dependence: Dependence) -> Law:
    """Return the learnt law of a dependence: its spline, as points of a curve."""
    gram, candidates, first = search.gram, search.candidates, len(search.gram.prior)
    place = dependence.place
    columns = [first + k for k, c in enumerate(candidates)
               if c.part and (c.place, c.regressor) == (place, dependence.regressor)]  # fmt: skip
    beta = gram.fit(np.array(columns), SELECTION, _RIDGE)[first:] / gram.scale[columns]
    spline = next(s for s in SPLINES if (s.place, s.regressor) == (place, dependence.regressor))
    knots = spline_knots(search.cases, spline)
    x = np.linspace(knots[0], knots[-1], _POINTS)
    used = [c.part[2] for k in columns if (c := candidates[k - first]).part]
    curve = LearntCurve(spline.over, spline.factor, x, beta @ basis_of(x, knots)[used])
    name = _name_with_place(f"learnt_law_of_{_slug(dependence.regressor)}", place)
    return _with_ranges(Law(name, place, dependence.regressor, (), {}, curve), search.cases)


def _with_ranges(law: Law, cases: Sequence[CaseModel]) -> Law:
    by_case = [c.variables.letters for c in cases]
    letters = {n: np.concatenate([each[n] for each in by_case]) for n in by_case[0]}
    return replace(law, ranges=ranges_of(law, letters))


def _slug(text: str) -> str:
    words = text.replace("'s", "").replace(",", "").replace(" at the ", " ").replace("the ", "").split()
    return "_".join(w for w in words if w != "a").replace("sensor_sensor", "sensor")


def _name_with_place(name: str, place: str) -> str:
    return name if place == "gear" or name.endswith(place) else f"{name}_at_{place}"


def learn(
    records: Sequence[Record],
    rig: Rig,
    provenance: LawProvenance | None = None,
    progress: Progress | None = None,
) -> LawResult:
    """Return the laws that a rig's simulation of records lacks, with their effect files.

    Raises IdentificationError when the records are too short or lack a channel that the rig needs.
    """
    tell = progress or (lambda step, share: None)
    with one_blas_thread():
        tell("fitting the model", 0.0)
        base = choices.fitted_base(records, rig)
        if is_at_floor(base.score(TEST)):
            return nothing_left(base, records)
        tell("looking for what is missing", 0.2)
        search = choices.make_search(base)
        tell("comparing laws", 0.6)
        depends = dependences(search.gram, search.candidates)
        models = choices.chosen_models(search, depends)
        taken = [k for m in models.taken for k in m.columns]
        depends = dependences(search.gram, search.candidates, taken) if taken else depends
        tell("fitting the law in the simulation", 0.75)
        return _result(search, depends, models, records, provenance)


def nothing_left(base: choices.Base, records: Sequence[Record]) -> LawResult:
    """Return the result where the base model is at the noise floor."""
    (before, noise), rig = base.levels(), base.rig
    duration = sum(c.duration for c in base.cases)
    return LawResult(rig.name, tuple(r.source for r in records), duration, rig, rig,
                     (), (), (), 0.0, (0.0, 0.0), 0.0, before, before, noise, at_floor=True)  # fmt: skip


def _result(
    search: choices.Search, depends: Sequence[Dependence], choice: choices.Choice, records: Sequence[Record],
    provenance: LawProvenance | None,
) -> LawResult:  # fmt: skip
    base = search.base
    laws = law_of(search, choice.taken)
    if choice.curve is not None:
        laws = [curve_of(search, choice.curve)]
    drafts = [draft_of(law) for law in laws]
    with lend(*(d.effect for d in drafts)):
        refined = refined_laws(base, drafts) if drafts else None
        gain, ci95 = gain_of(base.score(TEST), refined.score(TEST)) if refined else (0.0, (0.0, 0.0))
        if refined is None or not (gain >= choices.MATTERS and ci95[0] > 0.0):
            return replace(nothing_left(base, records), dependences=tuple(depends), at_floor=False,
                           tried=choices.summarize_models(search, choice, ()))  # fmt: skip
        (before, noise), (after, _) = base.levels(), refined.levels()
        written = finish_laws(drafts, refined, provenance, gain, ci95)
        rigs = base.rig, refined.rig
    acting = {e.name for e in rigs[0].effects}
    with_files = (EffectSetting(w.law.name, w.law.parameters) for w in written)
    return LawResult(
        rig_name=rigs[0].name, sources=tuple(r.source for r in records),
        duration=sum(c.duration for c in base.cases), base_rig=rigs[0],
        rig=rigs[1].with_effects(*(e for e in rigs[1].effects if e.name in acting), *with_files),
        dependences=tuple(depends), tried=choices.summarize_models(search, choice, choice.taken),
        laws=tuple(written), gain=gain, gain_ci95=ci95, share=share_of(before, after, noise),
        before=before, after=after, noise=noise, at_floor=False,
    )  # fmt: skip
