"""A channel beside the command on the command's clock, and its response by local polynomials.

The command is known at all times (it is held from stamp to stamp), the channel only at its own stamps. So
the command's clock is the grid, and the channel is shifted as little as possible: a constant offset stays an
offset, returned to the caller; only jitter, gaps and other rates are interpolated.

In a narrow band around line k both the response and the transient are smooth, and the command is not:

    Y(k + r) = (g_0 + g_1 r + g_2 r^2) U(k + r) + t_0 + t_1 r + t_2 r^2 + noise,   r = -n … n

Least squares over the band gives G(k) = g_0, its variance from the residual, and the noise.
(Schoukens, Vandersteen, Barbe, Pintelon, "Nonparametric preprocessing in system identification",
European Journal of Control 15, 2009.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.fft import rfft

from rsea_ros.errors import IdentificationError
from rsea_ros.records.record import BoolArray, Channel, ComplexArray, FloatArray, Record

_FEWEST = 32
_STEADY = 1e-3
_LONGEST_GAP = 3
_DEGREE = 7
_DRAWN = 15


class AtRestError(IdentificationError):
    """The record has no response: nothing is commanded while a channel is measured."""


@dataclass(frozen=True)
class Aligned:
    """Command and one channel on the command's clock, both shape (n,).

    command[i], N m, is held from start + i period to start + (i + 1) period, s.
    output[i] was acquired at start + i period + delay. measured[i]: false inside gaps of the recording.
    offsets: of the samples from the grid, in periods: one value, or quantiles of them where they jitter.
    held: the channel is itself a hold, read at its end (motor torque).
    rate: sample rate of the channel, Hz.
    """

    name: str
    start: float
    period: float
    command: FloatArray
    output: FloatArray
    delay: float
    measured: BoolArray
    offsets: FloatArray
    held: bool
    rate: float


def align(record: Record, name: str) -> Aligned:
    """Lay a channel beside the command. Raises IdentificationError for too few samples in common."""
    command, channel = (usable(record[n], f"{record.source}: {n}") for n in ("command", name))
    start, period = clock(command.t)
    period /= max(1, round(period * channel.rate))  # the command's clock, divided where this one is faster
    place = (channel.t - start) / period
    held = name == "motor_torque"
    if held:
        place = np.rint(place) - 1.0
    mean = np.exp(2j * np.pi * place).mean()
    offset = float(np.angle(mean) / (2.0 * np.pi)) if abs(mean) > 0.5 else 0.0  # of the samples, in periods
    first, last = max(0, int(np.ceil(place[0] - offset - 1e-6))), int(place[-1] - offset + 1e-6)
    last = min(last, round((command.t[-1] - start) / period))
    if last - first < _FEWEST:
        raise IdentificationError(
            f"{record.source}: command and {name} overlap for {max(0, last - first)} samples, "
            f"expected at least {_FEWEST}"
        )
    index = np.arange(first, last + 1, dtype=np.float64)
    return Aligned(
        name=name, start=start + first * period, period=period,
        command=held_mean(command, start + period * np.append(index, last + 1.0)),
        output=_at(place, channel.y, index + offset), delay=offset * period,
        measured=_outside_gaps(place - offset, index), offsets=_offsets(place - offset) + offset, held=held,
        rate=channel.rate,
    )


def usable(channel: Channel, where: str) -> Channel:
    """Return the samples that are finite and whose stamps rise. Raises IdentificationError for too few."""
    finite = np.isfinite(channel.t) & np.isfinite(channel.y)
    t, y = channel.t[finite], channel.y[finite]
    rising = np.ones(len(t), bool)
    rising[1:] = t[1:] > np.maximum.accumulate(t)[:-1]
    if np.count_nonzero(rising) < _FEWEST:
        raise IdentificationError(
            f"{where} has {np.count_nonzero(rising)} usable samples, expected at least {_FEWEST}"
        )
    return Channel(t[rising], y[rising])


def clock(t: FloatArray) -> tuple[float, float]:
    """Return start and period of the clock behind jittery stamps with gaps, by least squares, s."""
    steps = np.diff(t)
    count = np.concatenate([[0.0], np.cumsum(np.rint(steps / np.median(steps)))])
    middle, spread = count - count.mean(), t - t.mean()
    period = float(middle @ spread / (middle @ middle))
    return float(t.mean() - period * count.mean()), period


def held_mean(command: Channel, edges: FloatArray) -> FloatArray:
    """Return the mean of the held command between neighbouring edges, shape (n - 1,)."""
    area = np.concatenate([[0.0], np.cumsum(command.y[:-1] * np.diff(command.t))])
    reach = np.interp(edges, command.t, area)
    reach += command.y[-1] * np.maximum(edges - command.t[-1], 0.0)
    reach += command.y[0] * np.minimum(edges - command.t[0], 0.0)
    return np.asarray(np.diff(reach) / np.diff(edges))


def _at(place: FloatArray, y: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the channel at the wanted places: unchanged where sampled, otherwise by a spline."""
    near = np.searchsorted(place, wanted - 0.5)
    near = np.minimum(near, len(place) - 1)
    if np.all(np.abs(place[near] - wanted) < _STEADY):
        return y[near]
    from scipy.interpolate import make_interp_spline  # 0.1 s that even stamps need not wait for

    return np.asarray(make_interp_spline(place, y, k=_DEGREE)(wanted))


def _outside_gaps(place: FloatArray, index: FloatArray) -> BoolArray:
    """Return which places lie outside gaps longer than a spline can bridge."""
    step = np.diff(place)
    outside = np.ones(len(index), bool)
    for k in np.flatnonzero(step > max(1.0, float(np.median(step))) * (_LONGEST_GAP + 0.5)):
        outside[(index > place[k]) & (index < place[k + 1])] = False
    return outside


def _offsets(jitter: FloatArray) -> FloatArray:
    """Return quantiles of the samples' distance to the nearest place of the grid, one where it is steady."""
    distance = jitter - np.rint(jitter)
    if np.max(np.abs(distance)) < _STEADY:
        return np.zeros(1)
    return np.quantile(distance, (np.arange(_DRAWN) + 0.5) / _DRAWN)


@dataclass(frozen=True)
class Lines:
    """A sampled response, all shape (n,).

    frequency: Hz. response: output per held command. sd: of the complex response, widened for few degrees
    of freedom. coherence: 0 … 1. noise, distortion: RMS of the output in one line, see FrequencyResponse.
    """

    method: str
    frequency: FloatArray
    response: ComplexArray
    sd: FloatArray
    coherence: FloatArray
    noise: FloatArray | None = None
    distortion: FloatArray | None = None

    def up_to(self, highest: float) -> Lines:
        """Return the lines up to a frequency, Hz."""
        n = int(np.searchsorted(self.frequency, highest, side="right"))
        cut = {k: v[:n] for k, v in vars(self).items() if k != "method" and v is not None}
        return replace(self, **cut)


def widen(sd: FloatArray, freedom: FloatArray | float) -> FloatArray:
    """Return sd scaled so that the circle of radius 1.73 sd holds the truth in 95 % of cases.

    With the variance itself estimated from m = `freedom` complex values, |error|^2 / variance follows
    F(2, 2 m), which exceeds x with probability (1 + x / m)^-m; for a known variance with e^-x, so that its
    95 % point is -ln 0.05 = 1.73^2.
    """
    m = np.maximum(freedom, 1.0)
    quantile = m * (0.05 ** (-1.0 / m) - 1.0)
    return np.asarray(sd * np.sqrt(quantile / -np.log(0.05)))


def detrend(values: FloatArray) -> FloatArray:
    """Return values without their mean and slope."""
    place = np.linspace(-1.0, 1.0, len(values))
    slope = float(place @ values / (place @ place))
    return np.asarray(values - values.mean() - slope * place)


_UNKNOWNS = 6
_TINY = 1e-300
_ROUNDING = 1e-14
"""Of the output's power: less noise than this cannot be distinguished from rounding."""
_NARROWEST = 8
_RELATIVE_BAND = 0.03
"""Half the band as a share of its frequency, where that is wider than _NARROWEST lines."""


def local_polynomial(aligned: Aligned) -> Lines:
    """Return the response of the longest stretch without a gap, at lines a quarter band apart.

    Raises AtRestError where the command changes in none.
    """
    stretch = _longest(aligned)
    n = stretch.stop - stretch.start
    u, y = (rfft(detrend(x[stretch])) / np.sqrt(n) for x in (aligned.command, aligned.output))
    bands = _bands(len(u))
    response, variance, noise, power = _estimates(u, y, bands)
    freedom = np.array([2 * half + 1 - _UNKNOWNS for _, half in bands])
    signal = np.abs(response) ** 2 * power
    return Lines(
        method="local polynomial",
        frequency=np.array([centre for centre, _ in bands]) / (n * aligned.period), response=response,
        sd=widen(np.sqrt(variance), freedom), coherence=signal / (signal + noise + 1e-300),
        noise=np.sqrt(2.0 * noise / n),
    )


def _longest(aligned: Aligned) -> slice:
    """Return the longest stretch that was measured throughout and in which the command changes."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], aligned.measured.astype(np.int8), [0]])))
    stretches = [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    excited = [s for s in stretches if np.ptp(aligned.command[s]) > 0.0]
    if not excited:
        raise AtRestError(f"{aligned.name}: the command never changes where all is measured")
    return max(excited, key=lambda s: s.stop - s.start)


def _bands(lines: int) -> list[tuple[int, int]]:
    """Return centre and half-width of the bands, in lines; a quarter band apart."""
    bands, centre = [], _NARROWEST
    while centre < lines - 1:
        half = max(_NARROWEST, round(_RELATIVE_BAND * centre))
        bands.append((centre, half))
        centre += max(1, half // 2)
    return bands


def _estimates(
    u: ComplexArray, y: ComplexArray, bands: list[tuple[int, int]]
) -> tuple[ComplexArray, FloatArray, FloatArray, FloatArray]:
    """Return response, its variance, noise power and command power of all bands."""
    products = np.array([_products(u, y, centre, half) for centre, half in bands])
    scale = np.sqrt(np.einsum("bii->bi", products).real[:, :-1]) + _TINY
    inverse = np.linalg.pinv(products[:, :-1, :-1] / (scale[:, :, None] * scale[:, None]), hermitian=True)
    wanted = products[:, :-1, -1] / scale
    unknowns = np.einsum("bij,bj->bi", inverse, wanted)
    total = products[:, -1, -1].real
    residual = total - np.einsum("bi,bi->b", wanted.conj(), unknowns).real
    lines = np.array([2 * half + 1 for _, half in bands])
    noise = np.maximum(residual, _ROUNDING * total) / (lines - _UNKNOWNS)
    size = scale[:, 0]
    return unknowns[:, 0] / size, noise * inverse[:, 0, 0].real / size**2, noise, size**2 / lines


def _products(u: ComplexArray, y: ComplexArray, centre: int, half: int) -> ComplexArray:
    """Return the inner products of all columns of a band and the output, shape (7, 7)."""
    first = min(max(1, centre - half), len(u) - 2 * half - 1)
    band = slice(first, first + 2 * half + 1)
    r = (np.arange(first, band.stop) - centre) / half
    powers = np.stack([np.ones(len(r)), r, r**2])
    rows = np.concatenate([powers * u[band], powers, y[band][None]])
    return np.asarray(rows.conj() @ rows.T)
