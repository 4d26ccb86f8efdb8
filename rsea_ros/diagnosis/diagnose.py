"""Diagnosis: causes of a simulation's misfit, by stepwise selection among the effects of the catalogue.

The nominal model is fitted; effects are added one after another, each fitted to the training blocks and
accepted by the validation blocks (criteria.py); redundant ones are removed; the others are weighed on
the test blocks (naming/weighing.py), and named with gain and probability where allowed (naming/status.py).
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

from rsea_ros.checks.carried import check_diagnosable
from rsea_ros.checks.faults import Checked, check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate, is_apart
from rsea_ros.diagnosis.evaluation import Evaluated, Examined, Selection, evaluate, held_out_data
from rsea_ros.diagnosis.naming.conclusion import conclude
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.diagnosis.step_fits import StepFits
from rsea_ros.diagnosis.stepwise import eliminate_backwards, go_on, select_stepwise
from rsea_ros.diagnosis.stretches import in_stretches, stretches_of
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.effects.effect import Effect
from rsea_ros.errors import IdentificationError, RseaError
from rsea_ros.identification.confidence import stated_differences, torque_scale
from rsea_ros.identification.fit import as_recorded, unknowns_of, with_even_clocks
from rsea_ros.identification.identify import identify, lost_behind
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.result import Remark
from rsea_ros.identification.solver import Map, Pools, serial, worker_pools
from rsea_ros.identification.start import joint_start, scale_of, settled_starts
from rsea_ros.identification.unknowns import start_vector
from rsea_ros.model.extent import bound_values
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import MEASURED, Record


def diagnose(
    records: Sequence[Record],
    rig: Rig,
    holdout: Record | None = None,
    progress: Progress | None = None,
    settings: DiagnosisSettings | None = None,
) -> Diagnosis:
    """Find the causes of the misfit of a rig's simulation in records, and measure the gain of each.

    rig: effects that it states belong to the nominal model; their unknown parameters are fitted with the rig.
    Effects that it only guesses do not: the search treats them as all others.
    holdout: a record on which the models are tested; without it, the test blocks of the records. Channels of
    it that no record has are not tested.
    settings: the effects to try and the numbers that steer the verdict, DiagnosisSettings() by default.
    Raises IdentificationError when the records are too short or lack a channel that the rig needs, or the
    held-out record lacks all of theirs.
    """
    settings = settings or DiagnosisSettings()
    tell = progress or (lambda step, share: None)
    tell("checking the data", 0.0)
    rig = rig.with_effects(*(e for e in rig.effects if not e.guess))
    records = [bound_values(with_command(r, rig)) for r in records]
    holdout = bound_values(with_command(holdout, rig)) if holdout is not None else None
    for record in [*records, *([holdout] if holdout is not None else [])]:
        check_diagnosable(record)
    rig, unseen = as_recorded(rig, records)
    result = _diagnosed(records, rig, holdout, tell, settings)
    with suppress(RseaError):  # a simulation asks for more than a torque along the motion does
        if not result.at_noise_floor and (start := _rig_that_follows(records, rig, result)) is not None:
            simulated = _diagnosed(records, replace(rig, motion="simulated"), holdout, tell, settings, start)
            result = min(result, simulated, key=_over_noise)
    return replace(result, remarks=(*unseen, *result.remarks))


def _diagnosed(
    records: Sequence[Record], rig: Rig, holdout: Record | None, tell: Progress, settings: DiagnosisSettings,
    start: Rig | None = None,
) -> Diagnosis:
    """Diagnose a rig as it is judged. start: a rig whose values the first fit begins with."""
    checked, remarks = on_steady_clocks([check(r, rig) for r in records], rig)
    tested = on_steady_clocks([check(holdout, rig)], rig)[0][0] if holdout is not None else None
    examined = Examined(records, checked, tested, rig)
    with worker_pools() as pools:
        nominal = nominal_problem(checked, rig, settings, pools.run)
        if tested is not None:
            _check_testable(tested, nominal)
        tell("choosing stretches", 0.0)
        used = in_stretches(nominal, settings, pools.run)
        selection, stages = search(used, checked[0].record, tested, pools, tell, settings, start)
        tell("weighing the causes", 0.97)
        result = conclude(selection, stages, examined, pools, settings)
    cut = stretches_of(used, nominal, settings)
    lost = 0 if result.verdict == "nothing_wrong" else lost_behind(result.faults, result.before)
    likely = (Remark("lost_cycles", values=(float(lost),)),) if lost else ()
    known = (*torque_scale(nominal), *stated_differences(nominal))
    return replace(result, remarks=(*likely, *remarks, *cut, *known, *result.remarks))


_FOLLOWS = 90.0
"""Percent of fit to the position from which a simulation follows a motion well enough to be searched."""


def _rig_that_follows(records: Sequence[Record], rig: Rig, result: Diagnosis) -> Rig | None:
    """Return what was found along the motion of a rigid joint, where a simulation of it follows the motion.

    A weight or a spring holds the joint then. The filter of a measured motion smears each reversal, and the
    law of a friction with it; a simulation doesn't.
    """
    is_held = rig["spring_end.gravity"] > 0.0 or rig["spring_end.stiffness"] > 0.0
    if rig.motion or not (is_held and is_inverse(rig)):
        return None
    found = identify(records, replace(result.extended_rig, motion="simulated"), of_misfit=False)
    return found.rig if found.fit_percent["position"] > _FOLLOWS else None


def _over_noise(result: Diagnosis) -> float:
    """Return the largest of what a diagnosis leaves of its channels over their noise."""
    return max(result.extended_residual_rms[name] / noise for name, noise in result.noise_rms.items())


def nominal_problem(
    checked: Sequence[Checked], rig: Rig, settings: DiagnosisSettings = DEFAULT, run: Map = serial
) -> Problem:
    """Return the fit of a rig to checked records, the nominal model; moving loads begin where it has them."""
    cases = tuple(case_from(c.record, rig, c.masked) for c in checked)
    stated = frozenset(e.name for e in rig.effects)
    problem = Problem(cases, rig, unknowns_of(rig, cases), MEASURED, stated=stated)
    return settled_starts(problem, start_vector(problem.unknowns), run)[0]


def _check_testable(holdout: Checked, nominal: Problem) -> None:
    """Raise IdentificationError where a held-out record has no channel that models are fitted to."""
    fitted = sorted({n for case in nominal.cases for n in case.measured})
    case = case_from(holdout.record, nominal.rig, holdout.masked)
    if not case.measured.keys() & set(fitted):
        raise IdentificationError(
            f"{case.source}: held out, but has only {', '.join(sorted(case.measured))}; expected one of the"
            f" channels that the models are fitted to: {', '.join(fitted)}"
        )


def search(
    nominal: Problem,
    record: Record,
    holdout: Checked | None,
    pools: Pools,
    tell: Progress,
    settings: DiagnosisSettings,
    start: Rig | None = None,
) -> tuple[Selection, list[Evaluated]]:
    """Select causes beside the nominal model and evaluate every model of the selection.

    record: the first one, which gives a joint in its loop its start, where `start` is no other.
    """
    rig = nominal.rig
    effects = searched_effects(nominal, settings.without)
    is_plain = rig.loop is not None and rig.condition(record.source) is None
    start = start or (joint_start(record, rig) if is_plain else None)
    selection = select_stepwise(nominal, effects, pools, tell, settings, start)
    tell("looking for a simpler model", 0.9)
    selection = settled(selection, effects, pools, tell, settings)
    tell("evaluating on the test blocks", 0.95)
    held_out = held_out_data(selection, holdout)
    stages = pools.fits.map(lambda m: evaluate(selection, m, held_out, pools, settings), selection.models)
    return selection, list(stages)


def settled(
    selection: Selection, effects: Sequence[Effect], pools: Pools, tell: Progress, settings: DiagnosisSettings
) -> Selection:  # fmt: skip
    """Return a selection to which no cause can be added, and from which none can be taken.

    A cause that came in for several may make room for what they hid, so the search goes on from what is left.
    """
    seen = set[frozenset[str]]()
    while True:
        left = eliminate_backwards(selection, effects, pools, settings)
        causes = frozenset(left.last.causes)
        if causes == frozenset(selection.last.causes) or causes in seen:
            return left
        seen.add(causes)
        selection = go_on(left, effects, pools, tell, settings)
        if selection.last.causes == left.last.causes:
            return selection


def searched_effects(nominal: Problem, without: Collection[str]) -> list[Effect]:
    """Return the effects that are tried beside a nominal model, with bounds that suit its machine."""
    scale = scale_of(nominal.cases, nominal.rig)
    searched = (e for e in catalogue().values() if e.is_searched and e.name not in without)
    return [e.at(scale) for e in searched if is_apart(e, nominal)]


def best_single_effect(record: Record, rig: Rig) -> str:
    """Return the effect that leaves least when it is fitted alone to the training blocks; empty for none.

    What a search without held-out data would name: screened and fitted on short pieces as in the first step
    of a diagnosis.
    """
    problem = nominal_problem([check(record, rig)], rig)
    with worker_pools() as pools:
        current = fit_candidate(FitSetup(problem.cases, DEFAULT, pools.run), problem)
        effects = searched_effects(problem, ())
        fits = StepFits(current, effects, pools, DEFAULT, lambda step, share: None)
        pieces = fits.fit_pieces(fits.screen(fits.on_pieces)[: DEFAULT.forward.piece_fits])
    best = min(pieces, key=lambda s: s.cost, default=None)
    return best.name if best else ""


def on_steady_clocks(checked: Sequence[Checked], rig: Rig) -> tuple[list[Checked], tuple[Remark, ...]]:
    """Return records on the even clocks that their values agree with, and remarks on the changes."""
    steady = with_even_clocks([c.record for c in checked], [c.masked for c in checked], rig)
    records = zip(checked, steady.records, strict=True)
    return [replace(c, record=record) for c, record in records], steady.remarks
