"""Measured channels over those of the rig's simulation, by frequency, and the rig's shape fitted to them.

Both are sampled at the same stamps, so hold, sampling and leakage are alike in both, and the quotient

    R = sum_k Y_k P_k* / sum_k |P_k|^2

over half-overlapping Hann segments k is 1 at every line where the rig is right. Elsewhere the rig's values, a
gain and a delay for each channel are fitted,

    ln R(f) = ln(G(f; theta) / G(f; theta_0)) + g - i 2 pi f tau

with theta_0 the rig's values. Priors: theta by the rig's
spread, widened because a rig is a guess; g and tau by the caller. Lines that do not fit count less (Cauchy).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.errors import RseaError
from rsea_ros.identification.frequency_response import model_responses
from rsea_ros.identification.solver import Descent, descend
from rsea_ros.identification.unknowns import Unknown, apply, start_vector, unknowns_of_rig
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, ComplexArray, FloatArray, IntArray
from rsea_ros.records.statistics import next_fast_length, segment_spectra

_SEGMENTS = 5
"""A record is cut into segments of a fifth: slow ramps still have their line, and nine of them overlap."""
_LONGEST = 8.0
"""s. Of a segment, where the record has more than five such."""
_FEWEST = 16
"""Samples of a segment, at rates that put fewer into its longest."""
_LINES = 48
_ENOUGH = 0.3
"""Of the predicted power: lines that hold less say nothing of a channel."""
_FIRST = 2
_TINY = 1e-300
FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class Quotient:
    """Measured over predicted in bands of about equal width on a logarithmic scale.

    frequency: Hz, shape (n,). value: complex, shape (n,). coherence: 0 to 1, shape (n,).
    sd: standard deviation of ln(value), shape (n,). weight: share of the predicted power, shape (n,).
    segments: how many independent ones. lines: how many lines bear the predicted power. related: coherence
    of all lines, each by its share of the predicted power.
    measured, predicted: RMS without mean, in the channel's unit. captured: share of the predicted power that
    these lines hold.
    """

    channel: str
    frequency: FloatArray
    value: ComplexArray
    coherence: FloatArray
    sd: FloatArray
    weight: FloatArray
    segments: float
    lines: float
    related: float
    measured: float
    predicted: float
    captured: float

    @property
    def is_unrelated(self) -> bool:
        """Whether the channel has no more in common with the prediction than noise has by chance."""
        single = 1.0 - FALSE_ALARM ** (1.0 / max(self.segments - 1.0, 1.0))
        chance = 1.0 / self.segments
        limit = chance + (single - chance) / math.sqrt(max(self.lines, 1.0))
        return bool(self.related < limit and self.captured > _ENOUGH)


def quotient(channel: str, t: FloatArray, y: FloatArray, p: FloatArray) -> Quotient | None:
    """Return the quotient of measured y and predicted p at stamps t (s), None for too few samples."""
    if len(t) < 64 or not np.isfinite(p).all():
        return None
    period = float(np.median(np.diff(t)))
    even = np.arange(t[0], t[-1], period)
    y, p = (np.interp(even, t, v) for v in (y, p))
    if len(even) < _FEWEST * _SEGMENTS or not (np.std(p) > 0.0 and np.std(y) > 0.0):
        return None
    longest = next_fast_length(max(_FEWEST, int(_LONGEST / period)))
    length = min(len(even) // _SEGMENTS, longest)
    pp = _segments(p, length)
    if _captured_share(pp, p) < _ENOUGH:  # slow: its lines lie below those of short segments
        length = len(even) // _SEGMENTS
        pp = _segments(p, length)
    yy = _segments(y, length)
    cross = np.sum(yy * pp.conj(), axis=0)
    power_y, power_p = (np.sum(np.abs(v) ** 2, axis=0) + _TINY for v in (yy, pp))
    segments = len(yy) / (1.0 + 2.0 / 36.0) if len(yy) > 1 else 1.0
    share = power_p / power_p.sum()
    bands = _bands(len(cross))
    s_yp: ComplexArray = np.add.reduceat(cross, bands)
    s_pp, s_yy = (np.add.reduceat(v, bands) for v in (power_p, power_y))
    width = np.diff(np.append(bands, len(cross)))
    coherence = np.abs(s_yp) ** 2 / (s_pp * s_yy)
    averages = np.maximum(segments * width, 2.0)
    return Quotient(
        channel=channel,
        frequency=np.add.reduceat(np.arange(len(cross)) + _FIRST, bands) / width / (length * period),
        value=s_yp / s_pp, coherence=coherence,
        sd=np.sqrt(np.maximum(1.0 - coherence, 1e-6) / (2.0 * np.maximum(coherence, 1e-9) * averages)),
        weight=np.add.reduceat(share, bands), segments=segments, lines=1.0 / float(np.sum(share**2)),
        related=float(np.sum(share * np.abs(cross) ** 2 / (power_y * power_p))), measured=float(np.std(y)),
        predicted=float(np.std(p)), captured=_captured_share(pp, p),
    )


def _captured_share(spectra: ComplexArray, values: FloatArray) -> float:
    """Return the share of a signal's power that its segments' lines hold."""
    length = 2.0 * spectra.shape[1]
    power = 2.0 * float(np.mean(np.sum(np.abs(spectra) ** 2, axis=1))) / (0.375 * length**2)
    return float(power / np.var(values))


def usable(q: Quotient) -> BoolArray:
    """Return the informative bands: coherent, and with more than a trace of the predicted power."""
    keep: BoolArray = (q.coherence > 0.3) & (q.weight > 1e-7 * q.weight.max()) & np.isfinite(q.sd)
    return keep


def _segments(values: FloatArray, length: int) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments from the second line on, shape (k, lines)."""
    spectra = segment_spectra(values, length)
    return spectra[:, _FIRST : int(0.9 * spectra.shape[1])]


def _bands(lines: int) -> IntArray:
    """Return where each band begins, shape (bands,)."""
    edges = np.geomspace(1.0, lines + 1.0, _LINES + 1)[:-1]
    return np.unique(np.floor(edges).astype(np.int64) - 1)


MODEL_ERROR = 0.1
"""Of ln R: what a linear model leaves of a good bench with friction and play."""
DELAY_DOUBT = 0.02
"""s, one sigma, of the delay of a channel."""
_WIDER = 3.0
_LEAST = 0.3
"""One sigma of the logarithm of a rig's value, where the rig states less."""
_ITERATIONS, _PARTS = 12, (1.0, 0.3, 0.1)
"""Steps of the fit, and parts of one that are tried until it helps."""
_STEP = 1e-4
_DELAYS = np.arange(-0.06, 0.0605, 1e-3)
"""s. Where a fit of a delay may begin."""


@dataclass(frozen=True)
class Prior:
    """The prior of a channel's gain: sign, and mean and one sigma of the logarithm."""

    sign: float = 1.0
    mean: float = 0.0
    doubt: float = 0.25


@dataclass(frozen=True)
class FittedShape:
    """A fit of the shape. gain: logarithm, delay: s, both by channel.

    error: weighted median of the residual of ln R by channel, weights the predicted power. error_measured:
    weights the measured power, which shows what a channel has beside the prediction. values: of the rig, by
    name.
    reach: how many of the rig's stated spreads each has moved; data_share: the share of its information
    that the response provides.
    """

    values: Mapping[str, float]
    reach: Mapping[str, float]
    data_share: Mapping[str, float]
    gain: Mapping[str, float]
    delay: Mapping[str, float]
    error: Mapping[str, float]
    error_measured: Mapping[str, float]
    cost: float


class ShapeFit:
    """The quotients of a record, ready to be fitted under different beliefs about gains and signs."""

    def __init__(self, quotients: Mapping[str, Quotient], rig: Rig) -> None:
        kept = {n: (q, usable(q)) for n, q in quotients.items()}
        kept = {n: (q, keep) for n, (q, keep) in kept.items() if keep.any()}
        self.channels = tuple(kept)
        self._of = np.repeat(np.arange(len(kept)), [int(keep.sum()) for _, keep in kept.values()])
        self._frequency, self._value, sd = (
            np.concatenate([getattr(q, name)[keep] for q, keep in kept.values()] or [np.empty(0)])
            for name in ("frequency", "value", "sd")
        )
        self._sd = np.hypot(sd, MODEL_ERROR)
        self._share = np.concatenate([q.weight[keep] for q, keep in kept.values()] or [np.empty(0)])
        self._rig, self.unknowns = rig, _movable(rig)
        self._start = start_vector(self.unknowns)
        self._nominal = self._response(rig)

    def fit(self, priors: Mapping[str, Prior]) -> FittedShape:
        """Return the fit under a prior for the gain of each of `channels`."""
        sign = np.array([priors[n].sign for n in self.channels])[self._of]
        gain = np.array([priors[n].mean for n in self.channels])
        doubt = [_doubt(u) for u in self.unknowns]
        doubt += [priors[n].doubt for n in self.channels] + [DELAY_DOUBT] * len(gain)
        centre = np.concatenate([self._start, gain, np.zeros(len(gain))])
        begin = [self._size(k) if priors[n].doubt > 1.0 else gain[k] for k, n in enumerate(self.channels)]
        theta = np.concatenate([self._start, begin, self._delays(sign)])
        end = descend(
            lambda at: self._residual(at, sign), lambda at, r: self._slope(at, r, sign), theta,
            np.diag(np.array(doubt) ** -2.0), centre=centre, is_robust=True, rounds=_ITERATIONS, parts=_PARTS,
        )  # fmt: skip
        return self._shape(end, self._data_shares(end, np.array(doubt), sign))

    def _size(self, k: int) -> float:
        """Return the logarithm of a channel's gain over all its lines."""
        return float(np.median(np.log(np.abs(self._value[self._of == k]))))

    def _residual(self, theta: FloatArray, sign: FloatArray) -> FloatArray:
        """Return the residual of ln R over its doubt: of the size of all lines, then of their phase."""
        shape = self._response(self._rig_at(theta)) / self._nominal
        n, m = len(self._start), len(self.channels)
        gain, delay = theta[n : n + m][self._of], theta[n + m :][self._of]
        ratio = sign * self._value / shape * np.exp(2j * np.pi * self._frequency * delay)
        with np.errstate(all="ignore"):
            both = np.concatenate([(np.log(np.abs(ratio)) - gain) / self._sd, np.angle(ratio) / self._sd])
        return np.asarray(np.nan_to_num(both, nan=1e3, posinf=1e3, neginf=-1e3))

    def _slope(self, theta: FloatArray, residual: FloatArray, sign: FloatArray) -> FloatArray:
        """Return d residual / d theta, by differences for the rig's values, exact for gains and delays."""
        n, m, lines = len(self._start), len(self.channels), len(self._of)
        slope = np.zeros((2 * lines, len(theta)))
        for i, unknown in enumerate(self.unknowns):
            moved = theta.copy()
            moved[i] += _STEP * unknown.scale
            slope[:, i] = (self._residual(moved, sign) - residual) / (_STEP * unknown.scale)
        at = np.arange(lines)
        slope[at, n + self._of] = -1.0 / self._sd
        slope[lines + at, n + m + self._of] = 2.0 * np.pi * self._frequency / self._sd
        return slope

    def phase_cost(self, channel: str, sign: float) -> float:
        """Return the cost of the phases of a channel at its best delay, for a sign."""
        of = self._of == self.channels.index(channel)
        return float(np.min(self._phase_costs(of, np.full(len(of), sign))))

    def _delays(self, sign: FloatArray) -> FloatArray:
        """Return for each channel the delay on a coarse grid that leaves its phases smallest, s.

        Phases wrap: a fit that starts far off would stop in another minimum.
        """
        trial = np.zeros(len(self.channels))
        for k in range(len(trial)):
            trial[k] = _DELAYS[int(np.argmin(self._phase_costs(self._of == k, sign)))]
        return trial

    def _phase_costs(self, of: BoolArray, sign: FloatArray) -> FloatArray:
        turned = np.exp(2j * np.pi * np.outer(_DELAYS, self._frequency[of])) * (sign * self._value)[of]
        misfit = np.log1p((np.angle(turned) / (3.0 * self._sd[of])) ** 2).sum(axis=1)
        costs: FloatArray = misfit + (_DELAYS / DELAY_DOUBT) ** 2
        return costs

    def _rig_at(self, theta: FloatArray) -> Rig:
        try:
            return apply(self._rig, self.unknowns, theta[: len(self.unknowns)])[0]
        except (RseaError, OverflowError):
            return self._rig

    def _response(self, rig: Rig) -> ComplexArray:
        response = np.ones(len(self._of), complex)
        rows = {n: self._of == k for k, n in enumerate(self.channels) if n != "motor_torque"}
        for name, values in model_responses(rig, {n: self._frequency[of] for n, of in rows.items()}).items():
            response[rows[name]] = values
        return response

    def _middle(self, residual: FloatArray, k: int, weight: FloatArray) -> float:
        """Return the weighted median of a channel's residual."""
        of = self._of == k
        rising = np.argsort(residual[of])
        share = np.cumsum(weight[of][rising])
        return float(residual[of][rising][int(np.searchsorted(share, 0.5 * share[-1]))])

    def _data_shares(self, end: Descent, doubt: FloatArray, sign: FloatArray) -> FloatArray:
        """Return for each value the share of its information that the lines provide."""
        slope, weight = self._slope(end.theta, end.residual, sign), 1.0 / (1.0 + end.residual**2)
        normal = ((slope * weight[:, None]).T @ slope) * np.outer(doubt, doubt) + np.eye(len(doubt))
        shares: FloatArray = 1.0 - np.diag(np.linalg.inv(normal))
        return shares

    def _shape(self, end: Descent, shares: FloatArray) -> FittedShape:
        theta, residual = end.theta, end.residual
        n, m, lines = len(self._start), len(self.channels), len(self._of)
        misfit = np.hypot(residual[:lines], residual[lines:]) * self._sd
        measured = self._share * np.abs(self._value) ** 2
        known = zip(self.unknowns, theta[:n], strict=True)
        return FittedShape(
            values={u.name: u.outer(float(v)) for u, v in known},
            reach={
                u.name: abs(float(v) - u.inner(u.start)) / u.doubt
                for u, v in zip(self.unknowns, theta, strict=False)
            },
            data_share={u.name: float(share) for u, share in zip(self.unknowns, shares, strict=False)},
            gain=dict(zip(self.channels, theta[n : n + m].tolist(), strict=True)),
            delay=dict(zip(self.channels, theta[n + m :].tolist(), strict=True)),
            error={c: self._middle(misfit, k, self._share) for k, c in enumerate(self.channels)},
            error_measured={c: self._middle(misfit, k, measured) for k, c in enumerate(self.channels)},
            cost=end.cost,
        )


def _movable(rig: Rig) -> tuple[Unknown, ...]:
    return () if rig.rigid_spring else tuple(u for u in unknowns_of_rig(rig) if u.start > 0.0)


def _doubt(u: Unknown) -> float:
    """Return one sigma of a rig's value in the fit's coordinate."""
    return max(_WIDER * u.doubt, _LEAST * (1.0 if u.logarithmic else u.start))
