"""Answers that need no skill: the scores that any entry has to beat."""

from __future__ import annotations

import numpy as np

from rsea_ros.benchmark.answers import Answer
from rsea_ros.benchmark.dataset import Dataset

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
