"""The training, validation and test blocks of a record: stretches of time that no two sets share.

Of four blocks two neighbours train, one validates, one tests, in an order drawn anew for every four: with one
order for all, an excitation that repeats after four blocks would show each set the same part of it.
Where a held-out record is given, all of it tests instead.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.problem import Case
from rsea_ros.signals import BoolArray, FloatArray, IntArray

_LONGEST, _SHORTEST = 1.0, 0.25
"""s. Longer than the bench remembers, short enough that every part of a sweep is in every set."""
_ENOUGH = 120
"""Blocks: a record with fewer of the longest is cut into shorter ones."""
TRAIN, VALIDATION, TEST = (0, 1), (2,), (3,)
_ORDERS = np.array(
    [[0, 1, 2, 3], [0, 1, 3, 2], [2, 0, 1, 3], [3, 0, 1, 2], [2, 3, 0, 1], [3, 2, 0, 1]], dtype=np.int64
)
_PATTERN = _ORDERS[np.random.default_rng(4).integers(0, len(_ORDERS), 997)]
"""Set of each block, four in a row; repeats after more than an hour."""


def block_length(case: Case) -> float:
    """Return the length of a block, s: the longest, or less where a record would have too few of them."""
    return min(max(case.duration / _ENOUGH, _SHORTEST), _LONGEST)


def set_of(block: IntArray) -> IntArray:
    """Return the set of each block: a number in TRAIN, VALIDATION or TEST."""
    return np.asarray(_PATTERN[(block // 4) % len(_PATTERN), block % 4])


def train_starts(case: Case) -> FloatArray:
    """Return the times at which the pairs of training blocks begin, s since the case's start."""
    groups = int(case.duration / block_length(case)) // 4
    firsts = np.argmin(_PATTERN[np.arange(groups) % len(_PATTERN)], axis=1)
    return np.asarray((4 * np.arange(groups) + firsts) * block_length(case))


def blocks_of(case: Case, channel: str) -> IntArray:
    """Return the number of the block of each sample of a channel."""
    return np.maximum(np.floor((case.t[channel] - case.start) / block_length(case)), 0).astype(np.int64)


def part(case: Case, sets: tuple[int, ...]) -> Case:
    """Return the case with only the samples of some sets."""
    mask: dict[str, BoolArray] = {n: np.isin(set_of(blocks_of(case, n)), sets) for n in case.t}
    return case.within(mask)
