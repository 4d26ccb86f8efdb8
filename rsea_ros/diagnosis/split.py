"""Which samples fit, which choose, which judge: blocks of time that no two of these share.

The pattern of four blocks is fit, fit, choose, judge. With a held-out bag all of that judges instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.identification.problem import BoolArray, Case, Problem
from rsea_ros.signals import FloatArray

BLOCK = 1.0
"""s. Longer than any transient of the bench, short enough that every part of a sweep is in every set."""
FIT, CHOOSE, JUDGE = (0, 1), (2,), (3,)


def blocks_of(case: Case, channel: str) -> FloatArray:
    """Return the number of the block of each sample of a channel."""
    return np.maximum(np.floor((case.t[channel] - case.start) / BLOCK), 0).astype(np.int64)


def part(case: Case, places: tuple[int, ...], period: int = 4) -> Case:
    """Return the case with only the samples of some places of the pattern."""
    mask: dict[str, BoolArray] = {n: np.isin(blocks_of(case, n) % period, places) for n in case.t}
    return case.within(mask)


@dataclass(frozen=True)
class Score:
    """Squared weighted residuals summed by channel and block, and how many samples that were.

    sums, counts: by channel, shape (blocks,), of the blocks that have samples.
    """

    sums: dict[str, FloatArray]
    counts: dict[str, FloatArray]

    def loss(self, against: Score) -> FloatArray:
        """Return the loss of each block beside another model's, shape (blocks,).

        Every channel counts in units of what the other model leaves of it, or of its noise where that is more
        (maximum likelihood with unknown noise): no channel's fine sensor drowns the others.
        """
        scaled = [s / max(1.0, against.ratio(n)) ** 2 for n, s in self.sums.items()]
        return np.asarray(np.sum(scaled, axis=0))

    def ratio(self, channel: str) -> float:
        """RMS of the residual over the noise of a channel."""
        return float(np.sqrt(self.sums[channel].sum() / max(self.counts[channel].sum(), 1.0)))


def score(problem: Problem, cases: tuple[Case, ...], outputs: list[dict[str, FloatArray]]) -> Score:
    """Return the score of simulated outputs on the samples of `cases` (the problem's, otherwise masked)."""
    sums: dict[str, list[FloatArray]] = {n: [] for n in problem.channels}
    counts: dict[str, list[FloatArray]] = {n: [] for n in problem.channels}
    for case, out in zip(cases, outputs, strict=True):
        length = int(case.duration / BLOCK) + 2
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
    return Score({n: all_sums[n][used] for n in present}, {n: all_counts[n][used] for n in present})
