"""The signature of a cause: whether and where its law has the shape that the data show.

    c = y(with) - y(without),   lambda_b = 1 + c.r / c.c   in every block b

c: the contribution of the cause, r: the residual with it, both over the noise and without the parts that the
other unknowns can imitate (their derivatives are projected out). lambda_b is the factor of the contribution
that block b prefers. A right law gives 1 in every block; a look-alike is too large in some and too small
in others, although it helps overall. By amplitude, time and frequency lambda shows how a law is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.naming.contribution import ContributionRows, project_out
from rsea_ros.diagnosis.settings import DEFAULT, EvidenceSettings
from rsea_ros.records.record import FloatArray, IntArray

_SHIFTS = 6
"""Shifts in time by which a contribution is held against a residual that it has nothing to do with.

They steer `chance` alone, which people read and no probability does.
"""


@dataclass(frozen=True)
class Signature:
    """Spreads of lambda, weighted by c.c; 0 for a law that fits everywhere.

    scale: lambda of all test blocks together. spread: over the test blocks; over all blocks `overall`.
    chance: value of `overall` for a residual unrelated to the cause.
    carried: how surely the misfit of lambda lasts from block to block, in standard deviations: near 0 where
    only noise is left, also coloured noise shorter than a block, and large where a sensor wanders.
    amplitude, time, frequency: over parts of these. share: c.c / r.r. kept: the share of c.c that no other
    unknown imitates.
    """

    scale: float
    spread: float
    overall: float
    chance: float
    amplitude: float
    time: float
    frequency: float
    share: float
    kept: float
    carried: float = 0.0


def signature(rows: ContributionRows, rule: EvidenceSettings = DEFAULT.evidence) -> Signature:
    """Return the signature of a cause."""
    c, r = (project_out(rows, v) for v in (rows.contribution, rows.residual))
    cc, cr = c * c, c * r
    held_out = _sums(rows.block, cc * rows.tests, cr * rows.tests)
    every = _sums(rows.block, cc, cr)
    total = max(float(cc.sum()), 1e-300)
    return Signature(
        scale=1.0 + float(held_out[1].sum() / max(held_out[0].sum(), 1e-300)),
        spread=_spread(*held_out),
        overall=_spread(*every),
        chance=_by_chance(rows, c, r),
        amplitude=_spread(*_sums(_parts_by(np.abs(c), cc, rule.parts), cc, cr)),
        time=_spread(*_sums(_parts_by(rows.block.astype(float), cc, rule.parts), cc, cr)),
        frequency=_over_frequency(rows, c, r, rule.bands),
        share=total / max(float(r @ r), 1e-300),
        kept=total / max(float(rows.contribution @ rows.contribution), 1e-300),
        carried=_serial_correlation(*every),
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


def _serial_correlation(cc: FloatArray, cr: FloatArray) -> float:
    """Return the correlation of (cr - mean cc) / sqrt(cc) of neighbouring blocks over its standard error."""
    used = cc > 1e-12 * max(float(cc.sum()), 1e-300)
    cc, cr = cc[used], cr[used]
    off = (cr - cr.sum() / max(float(cc.sum()), 1e-300) * cc) / np.sqrt(cc)
    power = float(off @ off)
    return float(off[1:] @ off[:-1]) / power * float(np.sqrt(len(off))) if power > 0.0 else 0.0


def _parts_by(values: FloatArray, cc: FloatArray, parts: int) -> IntArray:
    """Return to which of some parts each row belongs: parts of equal cc in the order of `values`."""
    order = np.argsort(values, kind="stable")
    below = np.cumsum(cc[order])
    part = np.empty(len(values), np.int64)
    part[order] = np.minimum((parts * below / max(below[-1], 1e-300)).astype(np.int64), parts - 1)
    return part


def _by_chance(rows: ContributionRows, c: FloatArray, r: FloatArray) -> float:
    """Return the spread over blocks for a contribution that is shifted in time, RMS of several shifts."""
    spreads = []
    for k in range(1, _SHIFTS + 1):
        shifted = np.concatenate([np.roll(c[s], k * (s.stop - s.start) // (_SHIFTS + 1)) for s in rows.runs])
        spreads.append(_spread(*_sums(rows.block, shifted**2, shifted * r)))
    return float(np.sqrt(np.mean(np.square(spreads))))


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
