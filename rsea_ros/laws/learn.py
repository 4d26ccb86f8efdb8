"""The search for a law: the missing torque, its dependences, the shortest law, and its gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.identification.threads import one_blas_thread
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.assembly import curve_of, law_of
from rsea_ros.laws.base import Base, fitted_base, levels_of
from rsea_ros.laws.choice import Choice, Search, chosen_models, is_better, make_search, summarize_models
from rsea_ros.laws.dependence import Dependence, dependences
from rsea_ros.laws.effect_source import LawProvenance
from rsea_ros.laws.file import Draft, finish_laws
from rsea_ros.laws.fitting import gain_on_tests, refined_laws, share_of
from rsea_ros.laws.law import Law
from rsea_ros.laws.refinement import effect_from, register
from rsea_ros.laws.result import LawResult, WrittenLaw
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record


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
        base = fitted_base(records, rig)
        if is_at_floor(base.score(TEST)):
            return nothing_left(base, records)
        tell("looking for what is missing", 0.2)
        search = make_search(base)
        tell("comparing laws", 0.6)
        depends = dependences(search.gram, search.candidates)
        models = chosen_models(search, depends)
        taken = [k for m in models.taken for k in m.columns]
        depends = dependences(search.gram, search.candidates, taken) if taken else depends
        tell("fitting the law in the simulation", 0.75)
        return _result(search, depends, models, records, provenance)


def nothing_left(base: Base, records: Sequence[Record]) -> LawResult:
    """Return the result where the base model is at the noise floor."""
    before, noise = levels_of(base.problem, base.outputs, base.cases)
    rig = apply(base.problem.rig, base.problem.unknowns, base.solution.theta)[0]
    duration = sum(c.duration for c in base.cases)
    return LawResult(rig.name, tuple(r.source for r in records), duration, rig, rig,
                     (), (), (), 0.0, (0.0, 0.0), 0.0, before, before, noise, at_floor=True)  # fmt: skip


def _result(
    search: Search, depends: Sequence[Dependence], choice: Choice, records: Sequence[Record],
    provenance: LawProvenance | None,
) -> LawResult:  # fmt: skip
    base = search.base
    laws = _laws(search, choice)
    drafts = [Draft(law, effect_from(Draft.source(law), law.name)) for law in laws]
    with register([d.effect for d in drafts]):
        refined = refined_laws(base, drafts) if drafts else None
        if refined is None or not is_better(*gain_on_tests(base, refined)):
            return replace(nothing_left(base, records), dependences=tuple(depends), at_floor=False,
                           tried=summarize_models(search, choice, ()))  # fmt: skip
        gain, ci95 = gain_on_tests(base, refined)
        before, noise = levels_of(base.problem, base.outputs, base.cases)
        problem = replace(refined.solution.problem, cases=base.cases)
        after = levels_of(problem, problem.outputs(refined.solution.theta), base.cases)[0]
        share = share_of(before, after, noise)
        written = finish_laws(drafts, refined, base.cases, provenance, gain, ci95)
        rigs = [
            apply(s.problem.rig, s.problem.unknowns, s.theta)[0] for s in (base.solution, refined.solution)
        ]
    return LawResult(
        rig_name=rigs[0].name, sources=tuple(r.source for r in records),
        duration=sum(c.duration for c in base.cases), base_rig=rigs[0],
        rig=_with_files(rigs[1], rigs[0], written),
        dependences=tuple(depends), tried=summarize_models(search, choice, choice.taken), laws=tuple(written),
        gain=gain, gain_ci95=ci95, share=share, before=before, after=after, noise=noise, at_floor=False,
    )  # fmt: skip


def _with_files(rig: Rig, base: Rig, written: Sequence[WrittenLaw]) -> Rig:
    """Return a rig with the effects of the base and the laws that have files, with their parameters."""
    acting = {e.name for e in base.effects}
    laws = (EffectSetting(w.law.name, w.law.parameters) for w in written)
    return rig.with_effects(*(e for e in rig.effects if e.name in acting), *laws)


def _laws(search: Search, choice: Choice) -> list[Law]:
    if choice.curve is not None:
        return [curve_of(search.gram, search.candidates, search.cases, choice.curve)]
    return law_of(search.gram, search.candidates, search.cases, choice.taken)
