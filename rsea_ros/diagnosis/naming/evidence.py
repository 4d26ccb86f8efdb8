"""The evidence for a cause and its rivals from data that took part in no fit: gains, the shape of its law.

Computed once for every accepted cause and for rivals that do nearly as well in its place; status.py turns it
into a probability. The signature of a cause says whether and where its law has the shape that the data show:

    c = y(with) - y(without),   lambda_b = 1 + c.r / c.c   in every block b

c: the contribution of the cause, r: the residual with it, both over the noise and without the parts that the
other unknowns can imitate (their derivatives are projected out). lambda_b is the factor of the contribution
that block b prefers. A right law gives 1 in every block; a look-alike is too large in some and too small
in others, although it helps overall. By amplitude, time and frequency lambda shows how a law is wrong.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.criteria import preference
from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION
from rsea_ros.diagnosis.naming.flexible import (
    ContributionRows,
    Flexible,
    flexible,
    project_out,
    rows_of,
    weight_by,
)
from rsea_ros.diagnosis.score import Score, gain, score_on
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map
from rsea_ros.records.record import FloatArray, IntArray


@dataclass(frozen=True)
class Signature:
    """Spreads of lambda, weighted by c.c; 0 for a law that fits everywhere.

    overall: over all blocks. amplitude, time, frequency: over parts of these.
    carried: how surely the misfit of lambda lasts from block to block, in standard deviations: near 0 where
    only noise is left, also coloured noise shorter than a block, and large where a sensor wanders.
    lasting: the standard deviation of the part of lambda that does: by how much the cause's size wanders.
    """

    overall: float
    amplitude: float
    time: float
    frequency: float
    carried: float = 0.0
    lasting: float = 0.0


_PARTS, _BANDS = 4, 6
"""Parts of amplitude and of time, and frequency bands, for the shape of a law: fixed when the coefficients of
status.py were fitted (after a change, `python -m bench calibration fit`)."""


def signature(rows: ContributionRows) -> Signature:
    """Return the signature of a cause."""
    c, r = (project_out(rows, v) for v in (rows.contribution, rows.residual))
    cc, cr = c * c, c * r
    every = _sums(rows.block, cc, cr)
    carried, lasting = _lasting(*every)
    return Signature(
        overall=_spread(*every),
        amplitude=_spread(*_sums(_parts_by(np.abs(c), cc, _PARTS), cc, cr)),
        time=_spread(*_sums(_parts_by(rows.block.astype(float), cc, _PARTS), cc, cr)),
        frequency=_over_frequency(rows, c, r, _BANDS),
        carried=carried,
        lasting=lasting,
    )


def _sums(part: IntArray, cc: FloatArray, cr: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.asarray(np.bincount(part, cc), np.float64), np.asarray(np.bincount(part, cr), np.float64)


def _spread(cc: FloatArray, cr: FloatArray) -> float:
    """Return the standard deviation of lambda = 1 + cr / cc over parts, weighted by cc."""
    used = cc > 1e-12 * max(float(cc.sum()), 1e-300)
    cc, cr = cc[used], cr[used]
    if not len(cc):
        return 0.0
    mean = cr.sum() / cc.sum()
    return float(np.sqrt(np.sum(cc * (cr / cc - mean) ** 2) / cc.sum()))


def _lasting(cc: FloatArray, cr: FloatArray) -> tuple[float, float]:
    """Return how surely the misfit of lambda lasts from block to block, and the size of what lasts.

    The covariance of neighbouring blocks of (cr - mean cc) / sqrt(cc), over its standard error where some
    blocks scatter more than others (White, Econometrica 48, 1980), and as a standard deviation of lambda.
    """
    used = cc > 1e-12 * max(float(cc.sum()), 1e-300)
    cc, cr = cc[used], cr[used]
    off = (cr - cr.sum() / max(float(cc.sum()), 1e-300) * cc) / np.sqrt(cc)
    products, weights = off[1:] * off[:-1], np.sqrt(cc[1:] * cc[:-1])
    scatter = float(np.sqrt(products @ products))
    sure = float(products.sum()) / scatter if scatter > 0.0 else 0.0
    return sure, float(np.sqrt(max(products.sum(), 0.0) / max(float(weights.sum()), 1e-300)))


def _parts_by(values: FloatArray, cc: FloatArray, parts: int) -> IntArray:
    """Return to which of some parts each row belongs: parts of equal cc in the order of `values`."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(cc[order])
    part = np.empty(len(values), np.int64)
    part[order] = np.minimum((parts * below / max(below[-1], 1e-300)).astype(np.int64), parts - 1)
    return part


def _over_frequency(rows: ContributionRows, c: FloatArray, r: FloatArray, bands: int) -> float:
    """Return the spread of the complex lambda over frequency bands of equal ratio."""
    cc, cr = np.zeros(bands), np.zeros(bands, complex)
    for run in rows.runs:
        for length, segments in _segments(rows.block[run], 2 * bands):
            window = np.hanning(length + 2)[1:-1]
            c_hat, r_hat = (np.fft.rfft(v[run][segments] * window, axis=1)[:, 1:] for v in (c, r))
            lines = c_hat.shape[1]
            band = (bands * np.log(np.arange(1, lines + 1)) / np.log(lines + 1)).astype(np.int64)
            cc += np.bincount(band, np.sum(np.abs(c_hat) ** 2, axis=0), bands)
            cross = np.sum(c_hat.conj() * r_hat, axis=0)
            cr += np.bincount(band, cross.real, bands) + 1j * np.bincount(band, cross.imag, bands)
    used = cc > 0.0
    return float(np.sqrt(np.sum(np.abs(cr[used]) ** 2 / cc[used]) / max(cc.sum(), 1e-300)))


def _segments(block: IntArray, shortest: int) -> Iterator[tuple[int, IntArray]]:
    """Yield the length of the usual whole block and the rows of all such blocks, shape (blocks, length).

    shortest: rows that a block must have.
    """
    starts = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1])
    sizes = np.diff(np.append(starts, len(block)))
    length = int(np.median(sizes)) - 1
    if length >= shortest:
        yield length, starts[sizes >= length][:, None] + np.arange(length)


@dataclass(frozen=True)
class Evidence:
    """The evidence of held-out data for one cause.

    gain, gain_low: 1 - RMS(with) / RMS(without) of the channel that it helps most, and the lower end of its
    95 % interval. is_sure: the gain pays for the parameters. weight: of this cause among all effects tried in
    its place, 0 to 1. left: what its model leaves of the worst channel, over its noise. at_edge: a parameter
    is at a bound.
    """

    name: str
    signature: Signature
    flexible: Flexible | None
    channel: str
    gain: float
    gain_low: float
    is_sure: bool
    weight: float
    left: float
    at_edge: bool


@dataclass(frozen=True)
class Claim:
    """A model in which a cause acts, its score on test blocks, and the score without the cause."""

    name: str
    problem: Problem
    theta: FloatArray
    with_it: Score
    without: Score
    weight: float


def evidence_for(
    claim: Claim, cases: tuple[Case, ...], settings: DiagnosisSettings, run: Map
) -> Evidence | None:
    """Return the evidence for a claim; None where its simulation runs away."""
    everything = replace(claim.problem, cases=cases)
    sets, outputs = (*TRAIN, *VALIDATION, *TEST), everything.outputs(claim.theta)
    weights = score_on(everything, cases, sets, outputs, settings.blocks)
    problem = weight_by(claim.problem, cases, weights)
    rows = rows_of(problem, claim.theta, claim.name, settings, run)
    if rows is None:
        return None
    parameters = sum(u.name.startswith(claim.name + ".") for u in problem.unknowns)
    channel = min(
        claim.without.sums, key=lambda n: claim.with_it.ratio(n) / max(claim.without.ratio(n), 1e-12)
    )
    gained, (low, _) = gain(claim.with_it, claim.without, channel, settings.acceptance.resamples)
    return Evidence(
        name=claim.name, signature=signature(rows),
        flexible=flexible(problem, claim.theta, claim.name, rows, settings), channel=channel, gain=gained,
        gain_low=low,
        is_sure=preference(claim.with_it, claim.without, parameters, settings.acceptance).sure,
        weight=claim.weight,
        left=weights.ratio(weights.worst),
        at_edge=is_at_edge(problem, claim.theta, claim.name, settings.acceptance.near_bound),
    )


def is_at_edge(problem: Problem, theta: FloatArray, name: str, near: float) -> bool:
    """Return whether a parameter of an effect, optional ones apart, lies within a share `near` of a bound."""
    parameters = {f"{name}.{p.name}" for p in effect_named(name).parameters if not p.optional}
    unknowns = zip(problem.unknowns, theta, strict=True)
    return any(u.name in parameters and u.is_near_bound(float(t), near) for u, t in unknowns)
