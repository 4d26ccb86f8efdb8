"""Entries: the project's own and baselines."""

from __future__ import annotations

import numpy as np

from rsea_ros.benchmark.dataset import Answer, Dataset
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate
from rsea_ros.diagnosis.diagnose import diagnose, nominal_problem, searched_effects
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.diagnosis.step_fits import StepFits
from rsea_ros.identification.solver import worker_pools
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record


def diagnosis_answer(record: Record, rig: Rig) -> Answer:
    """Return the causes of a diagnosis, and their alternatives, with the probabilities that it states."""
    result = diagnose([record], rig)
    rivals = {a.name: a.probability for a in result.alternatives}
    causes = rivals | {c.name: c.probability for c in result.causes}
    return Answer(dict(sorted(causes.items(), key=lambda c: -c[1])))


def largest_gain(record: Record, rig: Rig) -> Answer:
    """Return the effect that leaves least when it is fitted alone to the training blocks, as certain.

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
    return Answer({best.name: 1.0} if best else {})


ENTRIES = {"diagnose": diagnosis_answer, "largest_gain": largest_gain}
"""Entries by name."""


SEED = 0


def no_names(dataset: Dataset) -> dict[str, Answer]:
    """Return answers that name nothing."""
    return {name: Answer() for name in dataset.hashes}


def random_names(dataset: Dataset) -> dict[str, Answer]:
    """Return answers that name one effect of the list at random, as certain."""
    rng = np.random.default_rng(SEED)
    return {name: Answer({str(rng.choice(dataset.effects)): 1.0}) for name in dataset.hashes}


BASELINES = {"no names": no_names, "random": random_names}
"""Rows that every table of scores begins with."""
