"""Which samples fit, which choose, which judge: blocks of time that no two of these share.

Of four blocks two next to each other fit, one chooses, one judges, in an order drawn anew for every four:
with one order for all, an excitation that repeats after four blocks would show each set the same part of it.
With a held-out bag all of that judges instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.coherence import missed_response
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.signals import BoolArray, FloatArray, IntArray

_LONGEST, _SHORTEST = 1.0, 0.25
"""s. Longer than the bench remembers, short enough that every part of a sweep is in every set."""
_ENOUGH = 120
FIT, CHOOSE, JUDGE = (0, 1), (2,), (3,)
_ORDERS = np.array(
    [[0, 1, 2, 3], [0, 1, 3, 2], [2, 0, 1, 3], [3, 0, 1, 2], [2, 3, 0, 1], [3, 2, 0, 1]], dtype=np.int64
)
_PATTERN = _ORDERS[np.random.default_rng(4).integers(0, len(_ORDERS), 997)]
"""Set of each block, four in a row; repeats after more than an hour."""


def block_length(case: Case) -> float:
    """Return how long a block is, s: where a record has fewer than enough of the longest, shorter."""
    return min(max(case.duration / _ENOUGH, _SHORTEST), _LONGEST)


def set_of(block: IntArray) -> IntArray:
    """Return to which set blocks belong: one of FIT, CHOOSE, JUDGE."""
    return np.asarray(_PATTERN[(block // 4) % len(_PATTERN), block % 4])


def fit_starts(case: Case) -> FloatArray:
    """Return where the pairs of FIT blocks begin, s since the case's start."""
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


@dataclass(frozen=True)
class Score:
    """Squared weighted residuals summed by channel and block, and how many samples that were.

    sums, counts: by channel, shape (blocks,), of the blocks that have samples. missed: coherence^2 of the F/T
    torque's residual with the command where the model misses a response (coherence.py), the largest of all.
    """

    sums: dict[str, FloatArray]
    counts: dict[str, FloatArray]
    missed: float = 0.0

    def loss(self, against: Score) -> FloatArray:
        """Return the loss of each block beside another model's, shape (blocks,).

        Every channel counts in units of what the other model leaves of it, or of its noise where that is more
        (maximum likelihood with unknown noise): no channel's fine sensor drowns the others.
        """
        scaled = [s / max(1.0, against.ratio(n)) ** 2 for n, s in self.sums.items()]
        return np.asarray(np.sum(scaled, axis=0))

    @property
    def worst(self) -> str:
        """The channel with the largest RMS of the residual over its noise."""
        return max(self.sums, key=self.ratio)

    def ratio(self, channel: str) -> float:
        """RMS of the residual over the noise of a channel."""
        return float(np.sqrt(self.sums[channel].sum() / max(self.counts[channel].sum(), 1.0)))


def score_on(
    problem: Problem, cases: Sequence[Case], places: tuple[int, ...], outputs: list[dict[str, FloatArray]]
) -> Score:
    """Return the score of simulated outputs on some of the blocks of `cases`."""
    return score(problem, tuple(part(c, places) for c in cases), outputs)


def score(problem: Problem, cases: tuple[Case, ...], outputs: list[dict[str, FloatArray]]) -> Score:
    """Return the score of simulated outputs on the samples of `cases` (the problem's, otherwise masked)."""
    sums: dict[str, list[FloatArray]] = {n: [] for n in problem.channels}
    counts: dict[str, list[FloatArray]] = {n: [] for n in problem.channels}
    missed = 0.0
    for case, out in zip(cases, outputs, strict=True):
        if "ft" in case.measured and "ft" in out:
            missed = max(missed, missed_response(case, out["ft"], "ft", blocks_of(case, "ft")))
        length = int(case.duration / block_length(case)) + 2
        for n in problem.channels:
            if n not in case.t or n not in out:
                sums[n].append(np.zeros(length))
                counts[n].append(np.zeros(length))
                continue
            keep = case.mask[n]
            weighted = ((out[n] - case.measured[n]) / case.noise[n])[keep] ** 2
            where = blocks_of(case, n)[keep]
            sums[n].append(np.asarray(np.bincount(where, weighted, length)[:length], dtype=np.float64))
            counts[n].append(np.bincount(where, minlength=length)[:length].astype(np.float64))
    all_sums = {n: np.concatenate(parts) for n, parts in sums.items()}
    all_counts = {n: np.concatenate(parts) for n, parts in counts.items()}
    used = np.sum(list(all_counts.values()), axis=0) > 0
    present = [n for n in problem.channels if all_counts[n].sum() > 0]
    sums_used, counts_used = ({n: a[n][used] for n in present} for a in (all_sums, all_counts))
    return Score(sums_used, counts_used, missed)
