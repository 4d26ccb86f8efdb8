"""The score of a model: squared residuals over the noise by channel and block, gains, and a response missed.

A response that a model misses may hide in the noise; coherence with the command shows it. In segments of a
block each, coherence^2 = |S_ru|^2 / (S_rr S_uu) of the residual r and the command u. Of K segments of mere
noise it exceeds 1 - a^(1 / (K - 1)) with probability a (Carter, IEEE Proc. 75, 1987).

The data count by their deviance D = sum_b d_b over blocks. That of a right model against a wrong one has the
scatter S^2 = n var(d_b) = 4 D where the residual is white noise. Far from the noise floor it is not:
neighbouring samples err alike, and blocks differ in sign. There w D counts, with w = 4 D / S^2,
at most 1, whose scatter agrees with its size (magnitude adjustment: Pauli, Racugno, Ventura, Statistica
Sinica 21, 2011). Counted in full, samples by the thousand would outweigh every prior.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.data_split import block_length, blocks_of, part
from rsea_ros.diagnosis.settings import DEFAULT, BlockSettings
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray, IntArray
from rsea_ros.records.statistics import cross_density, power_density

_LOST = 0.5
"""Coherence^2 below which more than half of a channel's power has nothing to do with the command."""
_MOST = 0.75
"""Share of the lines above an edge that must be lost, and of those below it that must not."""
_LINES = 1024
_SEGMENTS = 16
"""Of a spectrum at least: of fewer, noise alone is coherent."""
_SHORTEST = 8
"""Samples of a segment: a shorter one has no band to speak of."""
_LOWEST = 2.0
"""Hz: below it a drift may hide the command. But for _SHORTEST, these steer a remark and no verdict."""


_FALSE_ALARM, _CLEAR, _ENOUGH = 0.01, 0.3, 16
"""Of a missed response: probability that noise alone passes for one in any line of a record, which sets the
least coherence^2 by the number of blocks; coherence^2 above which one is missed, however small, and blocks
without faulty samples below which none is (with 16 blocks noise alone reaches 0.26 in one line of a
hundred)."""
_OWN_ERROR = 0.1
"""Share of the simulated response up to which an error of it is the simulation's own."""


def missed_response(case: Case, output: FloatArray, channel: str, blocks: IntArray) -> float:
    """Return the largest coherence^2 of a residual with the command where the model misses a response, or 0.

    blocks: number of the block of each sample of the channel; those with faulty samples are left out.
    """
    if not isinstance(case.drive, Drive):
        return 0.0
    u = case.drive.command_at(case.t[channel])
    parts = _segments(blocks, case.mask[channel])
    if len(parts) < _ENOUGH:
        return 0.0
    r, y, u_hat = (_spectra(parts, v) for v in (case.measured[channel] - output, output, u))
    power = (np.abs(r) ** 2).sum(axis=0) * (np.abs(u_hat) ** 2).sum(axis=0)
    coherence = np.abs(np.sum(r * u_hat.conj(), axis=0)) ** 2 / np.maximum(power, 1e-300)
    chance = 1.0 - (_FALSE_ALARM / r.shape[1]) ** (1.0 / (len(parts) - 1))
    limit = max(_CLEAR, chance)
    error, response = (np.abs(np.sum(v * u_hat.conj(), axis=0)) for v in (r, y))
    missed = error > _OWN_ERROR * response
    return float(np.max(np.where(missed & (coherence > limit), coherence, 0.0)))


def lost_above(case: Case, channel: str) -> float | None:
    """Return the frequency, Hz, of the best step above which an excited channel is mostly noise, or None."""
    if not isinstance(case.drive, Drive):
        return None
    t = case.t[channel]
    u, y = case.drive.command_at(t), case.measured[channel]
    rate, length = 1.0 / float(np.median(np.diff(t))), min(_LINES, len(t) // _SEGMENTS)
    if length < _SHORTEST:
        return None
    frequency, power = power_density(u, rate, length)
    cross = np.abs(cross_density(u, y, rate, length)[1]) ** 2
    coherence = cross / np.maximum(power * power_density(y, rate, length)[1], 1e-300)
    is_excited = (power > 1e-3 * np.median(power)) & (frequency > _LOWEST)
    is_lost, frequency = (coherence < _LOST)[is_excited], frequency[is_excited]
    if not len(is_lost):
        return None
    before: IntArray = np.cumsum(is_lost) - is_lost
    heard = np.cumsum(~is_lost[::-1])[::-1]
    edge, count = int(np.argmin(before + heard)), len(is_lost)
    is_step = heard[edge] <= (1.0 - _MOST) * (count - edge) and before[edge] <= (1.0 - _MOST) * edge
    return float(frequency[edge]) if is_step and 0 < edge < _MOST * count else None


def _segments(blocks: IntArray, good: BoolArray) -> list[IntArray]:
    """Return the samples of every block without masked ones, cut to the same length."""
    blocks_of_samples = np.split(np.arange(len(blocks)), np.flatnonzero(np.diff(blocks)) + 1)
    whole = [p for p in blocks_of_samples if good[p].all()]
    length = int(np.median([len(p) for p in whole])) - 2 if whole else 0
    return [p[:length] for p in whole if len(p) >= length > _SHORTEST]


def _spectra(parts: list[IntArray], values: FloatArray) -> ComplexArray:
    """Return the spectra of the segments without mean and highest line, shape (segments, frequencies)."""
    cut = np.array([values[p] - values[p].mean() for p in parts])
    return np.asarray(np.fft.rfft(cut * np.hanning(cut.shape[1]), axis=1)[:, 1:-1])


@dataclass(frozen=True)
class Score:
    """Squared weighted residuals summed by channel and block, and how many samples that were.

    sums, counts: by channel, shape (blocks,), of the blocks that have samples. missed: coherence^2 of the F/T
    torque's residual with the command where the model misses a response, the largest of all.
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
        return np.asarray(np.sum([s / against._units(n) ** 2 for n, s in self.sums.items()], axis=0))

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
    problem: Problem, cases: Sequence[Case], blocks: tuple[int, ...], outputs: list[dict[str, FloatArray]],
    rule: BlockSettings,
) -> Score:  # fmt: skip
    """Return the score of simulated outputs on some sets of the blocks of `cases`."""
    return score(problem, tuple(part(c, blocks, rule) for c in cases), outputs, rule)


def score(
    problem: Problem, cases: tuple[Case, ...], outputs: list[dict[str, FloatArray]], rule: BlockSettings
) -> Score:
    """Return the score of simulated outputs on the samples of `cases` (the problem's, otherwise masked)."""
    runs = list(zip(cases, outputs, strict=True))
    missed = [
        missed_response(c, o["ft"], "ft", blocks_of(c, "ft", rule))
        for c, o in runs if "ft" in c.measured and "ft" in o
    ]  # fmt: skip
    sums, counts, run = {}, {}, np.zeros(0, np.int64)
    for n in problem.channels:
        by_case = [_by_block(case, out, n, rule) for case, out in runs]
        run = np.repeat(np.arange(len(runs)), [len(part[0]) for part in by_case])
        sums[n], counts[n] = (np.concatenate(parts) for parts in zip(*by_case, strict=True))
    used = np.sum(list(counts.values()), axis=0) > 0
    present = [n for n in problem.channels if counts[n].sum() > 0]
    sums, counts = ({n: by_block[n][used] for n in present} for by_block in (sums, counts))
    return Score(sums, counts, max(missed, default=0.0), run[used])


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
    return np.asarray(values[_draws(len(values), resamples)].mean(axis=1))


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
