"""The score of a model: its squared residuals over the noise, by channel and block, and gains from them.

The data count by their deviance D = sum_b d_b over blocks. That of a right model against a wrong one has the
scatter S^2 = n var(d_b) = 4 D where the residual is white noise. Far from the noise floor it is not:
neighbouring samples err alike, and blocks differ in sign. There w D counts, with w = 4 D / S^2,
at most 1, whose scatter agrees with its size (magnitude adjustment: Pauli, Racugno, Ventura, Statistica
Sinica 21, 2011). Counted in full, samples by the thousand would outweigh every prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from rsea_ros.diagnosis.coherence import missed_response
from rsea_ros.diagnosis.data_split import block_length, blocks_of, part
from rsea_ros.diagnosis.settings import DEFAULT, BlockSettings
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.records.record import FloatArray, IntArray


@dataclass(frozen=True)
class Score:
    """Squared weighted residuals summed by channel and block, and how many samples that were.

    sums, counts: by channel, shape (blocks,), of the blocks that have samples. missed: coherence^2 of the F/T
    torque's residual with the command where the model misses a response (coherence.py), the largest of all.
    run: number of the run of each block, shape (blocks,); None where there is one.
    """

    sums: dict[str, FloatArray]
    counts: dict[str, FloatArray]
    missed: float = 0.0
    run: IntArray | None = None

    def loss(self, against: Score) -> FloatArray:
        """Return the loss of each block in the units of another score, shape (blocks,).

        Every channel of every run counts in units of its residual in the other model, or of its noise where
        that is larger (maximum likelihood with unknown noise): neither the finest sensor nor the run with
        the least noise dominates the others.
        """
        scaled = [s / against._units(n) ** 2 for n, s in self.sums.items()]
        return np.asarray(np.sum(scaled, axis=0))

    @property
    def worst(self) -> str:
        """The channel with the largest RMS of the residual over its noise."""
        return max(self.sums, key=self.ratio)

    def ratio(self, channel: str) -> float:
        """RMS of the residual over the noise of a channel."""
        return float(np.sqrt(self.sums[channel].sum() / max(self.counts[channel].sum(), 1.0)))

    def ratios_in(self, run: int) -> dict[str, float]:
        """Return the RMS of the residual over the noise in a run, by channel; of all where absent."""
        return {n: self._ratio_in(run, n) for n in self.sums}

    def _ratio_in(self, run: int, channel: str) -> float:
        blocks = slice(None) if self.run is None else self.run == run
        count = self.counts[channel][blocks].sum()
        return float(np.sqrt(self.sums[channel][blocks].sum() / count)) if count else self.ratio(channel)

    def _units(self, channel: str) -> FloatArray:
        """Return RMS of residual over noise in the run of each block, 1 at least, shape (blocks,)."""
        if self.run is None:
            return np.full(len(self.sums[channel]), max(1.0, self.ratio(channel)))
        by_run = [max(1.0, self._ratio_in(k, channel)) for k in range(int(self.run.max(initial=0)) + 1)]
        return np.array(by_run)[self.run]


def score_on(
    problem: Problem,
    cases: Sequence[Case],
    blocks: tuple[int, ...],
    outputs: list[dict[str, FloatArray]],
    rule: BlockSettings,
) -> Score:
    """Return the score of simulated outputs on some sets of the blocks of `cases`."""
    return score(problem, tuple(part(c, blocks, rule) for c in cases), outputs, rule)


def score(
    problem: Problem, cases: tuple[Case, ...], outputs: list[dict[str, FloatArray]], rule: BlockSettings
) -> Score:
    """Return the score of simulated outputs on the samples of `cases` (the problem's, otherwise masked)."""
    runs = list(zip(cases, outputs, strict=True))
    missed = [
        missed_response(c, o["ft"], "ft", blocks_of(c, "ft", rule), rule) for c, o in runs if _has_ft(c, o)
    ]
    sums, counts, run = {}, {}, np.zeros(0, np.int64)
    for n in problem.channels:
        by_case = [_by_block(case, out, n, rule) for case, out in runs]
        run = np.repeat(np.arange(len(runs)), [len(part[0]) for part in by_case])
        sums[n], counts[n] = (np.concatenate(parts) for parts in zip(*by_case, strict=True))
    used = np.sum(list(counts.values()), axis=0) > 0
    present = [n for n in problem.channels if counts[n].sum() > 0]
    sums, counts = ({n: by_block[n][used] for n in present} for by_block in (sums, counts))
    return Score(sums, counts, max(missed, default=0.0), run[used])


def _has_ft(case: Case, outputs: Mapping[str, FloatArray]) -> bool:
    return "ft" in case.measured and "ft" in outputs


def _by_block(
    case: Case, outputs: Mapping[str, FloatArray], channel: str, rule: BlockSettings
) -> tuple[FloatArray, FloatArray]:
    """Return sums of squares over the noise and numbers of samples of a channel, shape (blocks,) each."""
    length = int(case.duration / block_length(case, rule)) + 2
    if channel not in case.t or channel not in outputs:
        return np.zeros(length), np.zeros(length)
    keep = case.mask[channel]
    squares = ((outputs[channel] - case.measured[channel]) / case.noise[channel])[keep] ** 2
    block = blocks_of(case, channel, rule)[keep]
    sums = np.asarray(np.bincount(block, squares, length)[:length], dtype=np.float64)
    return sums, np.bincount(block, minlength=length)[:length].astype(np.float64)


def bootstrap_means(values: FloatArray, resamples: int = DEFAULT.acceptance.resamples) -> FloatArray:
    """Return the means of resampled blocks, shape (resamples,)."""
    means: FloatArray = values[_draws(len(values), resamples)].mean(axis=1)
    return means


def gain(
    with_it: Score, without: Score, channel: str, resamples: int = DEFAULT.acceptance.resamples
) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(residual with) / RMS(residual without) of a channel, and its 95 % bootstrap interval."""
    return gain_of(with_it.sums[channel], without.sums[channel], resamples)


def gain_of(
    after: FloatArray, before: FloatArray, resamples: int = DEFAULT.acceptance.resamples
) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(after) / RMS(before) and its 95 % bootstrap interval.

    after, before: squared residuals summed by block, shape (blocks,).
    """
    draws = _draws(len(after), resamples)
    resampled = 1.0 - np.sqrt(after[draws].sum(axis=1) / np.maximum(before[draws].sum(axis=1), 1e-300))
    low, high = np.quantile(resampled, [0.025, 0.975])
    return 1.0 - float(np.sqrt(after.sum() / max(before.sum(), 1e-300))), (float(low), float(high))


def _draws(blocks: int, resamples: int) -> IntArray:
    """Return which blocks make up each resample, the same in every call, shape (resamples, blocks)."""
    return np.random.default_rng(0).integers(0, blocks, (resamples, blocks))


class Weighable(Protocol):
    """A model with its score on the validation blocks and the cost of leaving known values."""

    @property
    def validation(self) -> Score: ...
    @property
    def prior_cost(self) -> float: ...


def likelier_by(model: Weighable, other: Weighable, far: float) -> float:
    """Return twice the log of the odds of a model against another.

    far: RMS of the residual over the noise, in the worst channel of both, from which the data are tempered.
    """
    gained = tempered_deviance(model.validation, other.validation, far)
    return gained + other.prior_cost - model.prior_cost


def tempered_deviance(model: Score, other: Score, far: float) -> float:
    """Return the decrease of twice the negative log likelihood of a model against another.

    In units of each channel's residual in the worse of the two.
    """
    worse = max(model, other, key=lambda s: float(s.loss(model).sum()))
    return float((tempered_loss(other, worse, far) - tempered_loss(model, worse, far)).sum())


def tempered_loss(model: Score, against: Score, far: float) -> FloatArray:
    """Return the loss of each block of a model, shape (blocks,); its distance from another's is tempered."""
    known = against.loss(against)
    differences = model.loss(against) - known
    is_far = min(s.ratio(s.worst) for s in (model, against)) >= far
    return known + differences * (temper(differences) if is_far else 1.0)


def temper(differences: FloatArray) -> float:
    """Return the weight, up to 1, by which the sum of blocks' differences has the scatter that it claims."""
    scatter = len(differences) * float(np.var(differences, ddof=1)) if len(differences) > 1 else np.inf
    claimed = 4.0 * abs(float(differences.sum()))
    return claimed / scatter if scatter > claimed else 1.0
