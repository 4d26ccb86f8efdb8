"""Frequency responses of a record from the command to each channel: by periods, by segments, unfolded.

A command that repeats is analysed by its periods, a long random one by averaged segments, anything else by
local polynomials. All give continuous-time responses: hold, acquisition instants and folded images are
taken out.

Averaged over segments k,

    G = sum Y_k U_k* / sum |U_k|^2,   var G = s2 (sum |U_k|^2 + 2 rho Re sum U_k U_{k+1}*) / (sum |U_k|^2)^2

s2 is the residual power of a segment and rho = 1/6 the correlation of noise between Hann segments that
overlap by half. (Welch, IEEE Trans. Audio Electroacoust. 15, 1967; Bendat, Piersol, Random Data, 4th ed., 9.)

A command held over T and samples taken d periods after its steps see, with x in cycles a period and
s_k = 2 pi i (x + k) / T,

    measured(x) = sum_k G(s_k) h(x + k) e^{2 pi i (x + k) d},   h(x) = sinc(x) e^{-i pi x}

k = 0 is wanted; the other images are folded into the band: at 0.36 of the sample rate they are 17 % of a
second-order response. Above the band every finite actuator is a short series in 1/s, late by a delay,

    G(s) ~ e^{-s tau} (m_1 / s + m_2 / s^2 + m_3 / s^3 + m_4 / s^4)

whose real Markov parameters m are fitted to the upper part of the band; the sampled 1/s^p is
known in closed form (sampled_integrators).
(Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed., section 4.3; Kailath, Linear Systems, 2.4.)

The spread between periods is noise. The mean period's power at lines that were not excited, beyond that
noise, is nonlinear distortion: even at even lines, odd at odd ones.
(Pintelon, Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., chapter 4.)
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.fft import irfft, rfft
from numpy.polynomial.polynomial import polyval

from rsea_ros.identification import local_polynomial as lpm
from rsea_ros.identification.problem import FEWEST
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.position_loop import close_loop
from rsea_ros.model.propagator import OUTPUT_ROWS, encoder_row, output_rows, state_space
from rsea_ros.model.rig import Rig, Sensor
from rsea_ros.records.record import ComplexArray, FloatArray, IntArray, Record
from rsea_ros.records.statistics import hann, next_fast_length, runs_of

LONGEST_SEGMENT = 16.0
"""s. Long against what the actuator remembers, so that segments leak little."""
FEWEST_SEGMENTS = 12
_SHORTEST_SEGMENT = 4.0
_FIRST_LINE = 2
_ALIKE = 0.25
"""Random segments come to 0.5 in the middle and 0.3 at the 5 % quantile that is asked."""
_OVERLAP_CORRELATION = 1.0 / 6.0
_TINY = 1e-300


def suits(aligned: lpm.Aligned) -> bool:
    """Return whether a record is long enough for this method, and its command alike in all segments.

    A sweep has its low frequencies in few segments: (sum |U|^2)^2 / sum |U|^4 counts them.
    """
    length = _length(aligned)
    starts = _starts(aligned, length)
    if length * aligned.period < _SHORTEST_SEGMENT or len(starts) < FEWEST_SEGMENTS:
        return False
    power = np.abs(_segments(aligned.command, starts, length)[:, _FIRST_LINE:]) ** 2
    bearing = np.sum(power, axis=0) ** 2 / (np.sum(power**2, axis=0) + _TINY)
    return float(np.quantile(bearing, 0.05)) > _ALIKE * len(starts)


def welch(aligned: lpm.Aligned) -> lpm.Lines:
    """Return the response by averaging over the segments that have no gap."""
    length = _length(aligned)
    starts = _starts(aligned, length)
    u, y = (_segments(x, starts, length) for x in (aligned.command, aligned.output))
    s_uu = np.sum(np.abs(u) ** 2, axis=0) + _TINY
    response = np.sum(y * u.conj(), axis=0) / s_uu
    effective = len(starts) / (1.0 + 2.0 * _OVERLAP_CORRELATION**2)
    residual = np.sum(np.abs(y - response * u) ** 2, axis=0) / len(starts) * effective / (effective - 1.0)
    next_to = (starts[1:] - starts[:-1] == length // 2)[:, None]
    turns = (-1.0) ** np.arange(u.shape[1])  # neighbours refer to one time: half a segment is pi a line
    overlap = np.sum(next_to * (u[1:] * u[:-1].conj() * turns).real, axis=0)
    spread = np.sqrt(residual * np.maximum(s_uu + 2.0 * _OVERLAP_CORRELATION * overlap, 0.5 * s_uu)) / s_uu
    s_yy = np.sum(np.abs(y) ** 2, axis=0) + _TINY
    keep = slice(_FIRST_LINE, None)
    return lpm.Lines(
        method="Welch", frequency=(np.arange(u.shape[1]) / (length * aligned.period))[keep],
        response=response[keep], sd=lpm.widen(spread, effective - 1.0)[keep],
        coherence=np.minimum(np.abs(response) ** 2 * s_uu / s_yy, 1.0)[keep],
        noise=(np.sqrt(2.0 * residual / np.sum(hann(length) ** 2) / length))[keep],
    )


def _length(aligned: lpm.Aligned) -> int:
    """Return the segment length in samples, even."""
    duration = len(aligned.command) * aligned.period
    seconds = min(LONGEST_SEGMENT, duration / (FEWEST_SEGMENTS / 2.0 + 1.0))
    return 2 * int(next_fast_length(int(seconds / aligned.period / 2.0), real=True))


def _starts(aligned: lpm.Aligned, length: int) -> IntArray:
    starts = np.arange(0, len(aligned.command) - length + 1, length // 2)
    missing = np.concatenate([[0], np.cumsum(~aligned.measured)])
    return np.asarray(starts[missing[starts + length] == missing[starts]])


def _segments(values: FloatArray, starts: IntArray, length: int) -> ComplexArray:
    """Return the windowed spectra, shape (segments, lines)."""
    windows = np.lib.stride_tricks.sliding_window_view(lpm.detrend(values), length)[starts]
    return rfft(windows * hann(length), axis=1)


_ORDERS = np.arange(1, 5)
_FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0, 24.0])
_EULERIAN = ((1.0,), (0.0, 1.0), (0.0, 1.0, 1.0), (0.0, 1.0, 4.0, 1.0), (0.0, 1.0, 11.0, 11.0, 1.0))
"""sum_n n^j w^n = (these coefficients in w) / (1 - w)^(j + 1)."""
_FITTED_BAND = (0.18, 0.42)
"""Cycles a period: where the series is fitted."""
_FITTED_LINES = 80
_DELAYS = np.arange(0.0, 3.01, 0.125)
"""Delays that are tried, in periods."""
_NO_DELAY_WITHIN = 1.2


def unfold(
    aligned: lpm.Aligned, frequency: FloatArray, measured: ComplexArray, sd: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Return the continuous-time response and its sd. frequency: Hz; measured: output per held command."""
    x = frequency * aligned.period
    at_steps = measured * np.exp(-2j * np.pi * frequency * aligned.delay)
    if aligned.held:
        return at_steps, sd
    response: ComplexArray = (at_steps - _fold(x, at_steps, sd, aligned.offsets)) / _hold(x)
    return response, sd / np.abs(_hold(x))


def sampled_integrators(x: FloatArray, offset: float) -> ComplexArray:
    """Return 1/s^p after hold and sampling, p = 1 … 4, per period^p, shape (4, n).

    e^{-2 pi i x d} (1 - w) sum_{n + d > 0} (n + d)^p / p! w^n,   w = e^{-2 pi i x}
    """
    whole, rest = divmod(offset, 1.0)
    w = np.exp(-2j * np.pi * x)
    sums = np.array([polyval(w, c) / (1.0 - w) ** (j + 1) for j, c in enumerate(_EULERIAN)])
    terms = [_shifted_power(sums, int(p), rest) / _FACTORIALS[p] for p in _ORDERS]
    return np.asarray(np.array(terms) * (1.0 - w) * w ** (-whole) * np.exp(-2j * np.pi * x * offset))


def _shifted_power(sums: ComplexArray, p: int, d: float) -> ComplexArray:
    """Return sum_n (n + d)^p w^n from sum_n n^j w^n, by the binomial theorem."""
    factors = [_FACTORIALS[p] / (_FACTORIALS[j] * _FACTORIALS[p - j]) * d ** (p - j) for j in range(p + 1)]
    return np.tensordot(factors, sums[: p + 1], axes=1)


def _fold(x: FloatArray, measured: ComplexArray, sd: FloatArray, offsets: FloatArray) -> ComplexArray:
    """Return the sum of all images but the wanted one."""
    lines = np.flatnonzero((x > _FITTED_BAND[0]) & (x < _FITTED_BAND[1]) & (sd > 0.0))
    if len(lines) < 2 * len(_ORDERS):
        return np.zeros(len(x), complex)
    lines = lines[:: max(1, len(lines) // _FITTED_LINES)]
    delay, markov = _fit(x[lines], measured[lines], sd[lines], offsets)
    wanted = _hold(x) / (2j * np.pi * x) ** _ORDERS[:, None] * np.exp(-2j * np.pi * x * delay)
    return np.asarray(markov @ (_basis(x, offsets, delay) - wanted))


def _fit(
    x: FloatArray, measured: ComplexArray, sd: FloatArray, offsets: FloatArray
) -> tuple[float, FloatArray]:
    """Return the delay in periods, and the Markov parameters that fit best with it."""
    fits = []
    for delay in _DELAYS:
        rows, wanted = _real(_basis(x, offsets, delay) / sd).T, _real(measured / sd)
        size = np.linalg.norm(rows, axis=0)
        markov = np.linalg.lstsq(rows / size, wanted, rcond=1e-9)[0] / size
        fits.append((float(np.sum((rows @ markov - wanted) ** 2)), float(delay), markov))
    best = min(fits, key=lambda fit: fit[0])
    chosen = fits[0] if fits[0][0] <= _NO_DELAY_WITHIN * best[0] else best
    return chosen[1], chosen[2]


def _basis(x: FloatArray, offsets: FloatArray, delay: float) -> ComplexArray:
    """Return the sampled integrators, late by `delay` periods, averaged over the offsets of the samples."""
    sampled = [sampled_integrators(x, float(d) - delay) for d in offsets]
    return np.asarray(np.mean(sampled, axis=0) * np.exp(-2j * np.pi * x * delay))


def _hold(x: FloatArray) -> ComplexArray:
    return np.asarray(np.sinc(x) * np.exp(-1j * np.pi * x))


def _real(values: ComplexArray) -> FloatArray:
    return np.concatenate([values.real, values.imag], axis=-1)


FEWEST_PERIODS = 3
"""One settles, two separate noise from signal."""
_SAME = 0.02
_MOVES = 0.5
"""Of a command's standard deviation: a period moves more; a slow command is alike from sample to sample."""
_LIKELY = 0.5
_TRIED = 12


@dataclass(frozen=True)
class Periods:
    """A stretch of whole periods: first sample, samples a period, how many."""

    first: int
    length: int
    count: int


def find_periods(command: FloatArray) -> Periods | None:
    """Return the longest stretch over which a command repeats at least FEWEST_PERIODS times, or None."""
    candidates = (_stretch(command, lag) for lag in _likely_lags(command))
    return next((p for p in candidates if p is not None and p.count >= FEWEST_PERIODS), None)


def _likely_lags(command: FloatArray) -> list[int]:
    """Return the shortest lags at which the autocorrelation peaks, samples."""
    n = len(command)
    centred = command - command.mean()
    size = next_fast_length(2 * n, real=True)
    correlation = irfft(np.abs(rfft(centred, size)) ** 2, size)[: n // FEWEST_PERIODS + 1]
    if len(correlation) < 3 or correlation[0] <= 0.0:
        return []
    unbiased = correlation / correlation[0] * n / (n - np.arange(len(correlation)))
    inner, after = unbiased[1:], np.append(unbiased[2:], 0.0)
    peaks = 1 + np.flatnonzero((inner > unbiased[:-1]) & (inner >= after) & (inner >= _LIKELY))
    high = peaks[unbiased[peaks] > 0.9 * unbiased[peaks].max()] if len(peaks) else peaks
    return [int(lag) for lag in high[:_TRIED]]


def _stretch(command: FloatArray, lag: int) -> Periods | None:
    """Return the longest stretch that repeats with this lag."""
    same = np.abs(command[lag:] - command[:-lag]) <= _SAME * np.std(command)
    runs = runs_of(same)
    if not len(runs):
        return None
    start, stop = (int(edge) for edge in runs[np.argmax(np.diff(runs)[:, 0])])
    count = (stop - start) // lag + 1
    periods = Periods(stop + lag - count * lag, lag, count)
    period = command[periods.first : periods.first + lag]
    return periods if np.ptp(period) > _MOVES * np.std(command) else None


_EXCITED = 1e-2
_SMOOTHED = 9


@dataclass(frozen=True)
class Distortion:
    """RMS of the output in a line, at the excited lines, shape (n,), in the channel's unit.

    noise: of one period. even, odd: nonlinear distortion of the mean period, None where no such line was
    left unexcited.
    """

    noise: FloatArray
    even: FloatArray | None
    odd: FloatArray | None

    @property
    def total(self) -> FloatArray | None:
        """Even and odd together, None if neither can be determined."""
        known = [part**2 for part in (self.even, self.odd) if part is not None]
        return np.sqrt(np.sum(known, axis=0)) if known else None


def multisine(aligned: lpm.Aligned, periods: Periods) -> lpm.Lines:
    """Return the response at the excited lines. The first period is left to settle."""
    u, y = (_periods(x, periods) for x in (aligned.command, aligned.output))
    whole = _periods(aligned.measured.astype(float), periods, spectrum=False).all(axis=1)
    if np.count_nonzero(whole) >= 2:
        u, y = u[whole], y[whole]
    mean_u, mean_y, count = u.mean(axis=0), y.mean(axis=0), len(y)
    size = np.abs(mean_u)
    size[0] = 0.0
    excited = np.flatnonzero(size > _EXCITED * size.max())
    variance = np.sum(np.abs(y - mean_y) ** 2, axis=0) / (count - 1)
    levels = _levels(mean_y, variance / count, excited, periods.length)
    odd = 0.0 if levels.odd is None else levels.odd**2 * periods.length**2 / 2.0
    spread = np.sqrt(variance[excited] / count + odd) / np.abs(mean_u[excited])
    freedom = (count - 1) * (1.0 + odd / (variance[excited] / count + 1e-300))
    power = np.abs(mean_y[excited]) ** 2
    return lpm.Lines(
        method="multisine", frequency=excited / (periods.length * aligned.period),
        response=mean_y[excited] / mean_u[excited],
        sd=lpm.widen(spread, np.minimum(freedom, count - 1 + _SMOOTHED)),
        coherence=power / (power + variance[excited] + 1e-300), noise=levels.noise * np.sqrt(count),
        distortion=levels.total,
    )


def _periods(values: FloatArray, periods: Periods, spectrum: bool = True) -> ComplexArray:
    """Return the spectra of all periods but the first, shape (count - 1, lines)."""
    stop = periods.first + periods.count * periods.length
    table = values[periods.first : stop].reshape(periods.count, periods.length)[1:]
    return rfft(table, axis=1) if spectrum else table.astype(complex)


def _levels(mean_y: ComplexArray, variance: FloatArray, excited: IntArray, length: int) -> Distortion:
    """Return noise and distortion at the excited lines. variance: of the mean period."""
    lines = np.arange(1, int(excited.max()) + 1)
    silent = np.setdiff1d(lines, excited)
    rms = np.sqrt(2.0) / length

    def level(at: IntArray) -> FloatArray | None:
        if len(at) < _SMOOTHED:
            return None
        beyond = _smooth(np.abs(mean_y[at]) ** 2 - variance[at])
        return np.asarray(rms * np.sqrt(np.maximum(np.interp(excited, at, beyond), 0.0)))

    noise = np.interp(excited, lines, _smooth(variance[lines]))
    return Distortion(rms * np.sqrt(noise), level(silent[silent % 2 == 0]), level(silent[silent % 2 == 1]))


def _smooth(values: FloatArray) -> FloatArray:
    """Return the running mean over _SMOOTHED lines."""
    if len(values) < _SMOOTHED:
        return np.full(len(values), values.mean())
    padded = np.pad(values, _SMOOTHED // 2, mode="edge")
    return np.convolve(padded, np.full(_SMOOTHED, 1.0 / _SMOOTHED), mode="valid")


UNFILTERED = Sensor()
HIGHEST = 0.45
"""Of the sample rate: above it an image is as large as the response itself."""


def sampled_lines(aligned: lpm.Aligned) -> lpm.Lines:
    """Return the sampled response by the method that the command allows."""
    periods = find_periods(aligned.command)
    if periods is not None:
        return multisine(aligned, periods)
    return welch(aligned) if suits(aligned) else lpm.local_polynomial(aligned)


def estimate_response(record: Record, output: str, sensor: Sensor = UNFILTERED) -> FrequencyResponse:
    """Return output per command, as it is before the delay and the filter that its sensor is known to have.

    Raises ChannelError for a missing channel and IdentificationError for one too short.
    """
    aligned = lpm.align(record, output)
    lines = sampled_lines(aligned).up_to(HIGHEST * min(1.0 / aligned.period, aligned.rate))
    known, period = sensor.filter, 1.0 / aligned.rate
    passed, sampled = sensor.response(lines.frequency, period), np.ones(len(lines.frequency), complex)
    if known is not None and known.is_sampled:  # then the images have passed it as the wanted response has
        sampled = known.response(lines.frequency, period)
    response, sd = unfold(aligned, lines.frequency, lines.response / sampled, lines.sd / np.abs(sampled))
    response, sd = response * sampled / passed, sd * np.abs(sampled / passed)
    return FrequencyResponse("command", output, **{**vars(lines), "response": response, "sd": sd})


def responses_of(record: Record, rig: Rig) -> tuple[FrequencyResponse, ...]:
    """Return the measured responses of a record's sensors to the command, of those that move.

    A sensor that is too slow for every line of the command shows none.
    """
    outputs = [n for n in ("ft", "position", "deflection") if n in record and rig.measures(n)]
    if record["command"].is_still:
        return ()
    responses = []
    for name in (n for n in outputs if len(record[n]) >= FEWEST and not record[n].is_still):
        with suppress(lpm.AtRestError):
            responses.append(estimate_response(record, name, rig.sensors.get(name, UNFILTERED)))
    return tuple(r for r in responses if len(r.frequency) > 0)


def model_response(rig: Rig, output: str, frequency: FloatArray) -> ComplexArray:
    """Return output / command of the rig's linear part, at frequencies in Hz, shape (n,).

    The command is the motor torque, or the target of a position loop.
    """
    return model_responses(rig, {output: frequency})[output]


def model_responses(rig: Rig, frequencies: Mapping[str, FloatArray]) -> dict[str, ComplexArray]:
    """Return output / command of the linear part of a rig by output, each at frequencies in Hz, (n,)."""
    system = state_space(rig)
    eye = np.eye(len(system.a))
    responses = {}
    for output, frequency in frequencies.items():
        s = np.asarray(2j * np.pi * np.asarray(frequency), np.complex128)
        solved = np.linalg.solve(
            s[:, None, None] * eye - system.a, np.broadcast_to(system.b[:, :1], (len(s), len(eye), 1))
        )[:, :, 0]
        row = output_rows(rig, system.mechanics)[OUTPUT_ROWS.index(output)]
        response = np.einsum("j,kj->k", row, solved)
        plant = np.einsum("j,kj->k", encoder_row(rig, system.mechanics), solved)
        responses[output] = response if rig.loop is None else close_loop(rig, plant, response, s)
    return responses
