"""The effect that explains most alone: what a search without held-out data would name."""

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate
from rsea_ros.diagnosis.diagnose import nominal_problem, searched_effects
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.step_fits import StepFits
from rsea_ros.identification.solver import worker_pools
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record


def best_single_effect(record: Record, rig: Rig) -> str:
    """Return the effect that leaves least when it is fitted alone to the training blocks; empty for none.

    Screened and fitted on short pieces as in the first step of a diagnosis; the likes of held-out data,
    noise floor and probability have no part.
    """
    problem = nominal_problem([check(record, rig)], rig)
    with worker_pools() as pools:
        current = fit_candidate(FitSetup(problem.cases, DEFAULT, pools.run), problem)
        effects = searched_effects(problem, ())
        fits = StepFits(current, effects, pools, DEFAULT, lambda step, share: None)
        pieces = fits.fit_pieces(fits.screen(fits.on_pieces)[: DEFAULT.forward.piece_fits])
    best = min(pieces, key=lambda s: s.cost, default=None)
    return best.name if best else ""
