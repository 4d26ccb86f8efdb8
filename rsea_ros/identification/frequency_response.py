"""Frequency responses of a record from the command to each channel, and those by periods of a multisine.

A command that repeats is analysed by its periods, a long random one by averaged segments, anything else by
local polynomials. All give continuous-time responses: hold, acquisition instants and folded images are
taken out (welch.py).

The spread between periods is noise. The mean period's power at lines that were not excited, beyond that
noise, is nonlinear distortion: even at even lines, odd at odd ones.
(Pintelon, Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., chapter 4.)
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.effects import signal_table as st
from rsea_ros.identification.local_polynomial import (
    Aligned,
    AtRestError,
    Lines,
    align,
    local_polynomial,
    widen,
)
from rsea_ros.identification.problem import FEWEST
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.identification.welch import suits, unfold, welch
from rsea_ros.model.equations import Mechanics
from rsea_ros.model.position_loop import close_loop
from rsea_ros.model.propagator import encoder_row, read_row, state_space
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray, IntArray, Record
from rsea_ros.records.spectra import next_fast_length

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
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    starts, stops = edges[::2], edges[1::2]
    if len(starts) == 0:
        return None
    longest = int(np.argmax(stops - starts))
    count = int((stops[longest] - starts[longest]) // lag + 1)
    periods = Periods(int(stops[longest] + lag - count * lag), lag, count)
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


def multisine(aligned: Aligned, periods: Periods) -> Lines:
    """Return the response at the excited lines. The first period is left to settle."""
    u, y = (_periods(x, periods) for x in (aligned.command, aligned.output))
    whole = _periods(aligned.measured.astype(float), periods, spectrum=False).all(axis=1)
    if np.count_nonzero(whole) >= 2:
        u, y = u[whole], y[whole]
    mean_u, mean_y, count = u.mean(axis=0), y.mean(axis=0), len(y)
    excited = excited_lines(mean_u)
    variance = np.sum(np.abs(y - mean_y) ** 2, axis=0) / (count - 1)
    levels = _levels(mean_y, variance / count, excited, periods.length)
    odd = 0.0 if levels.odd is None else levels.odd**2 * periods.length**2 / 2.0
    spread = np.sqrt(variance[excited] / count + odd) / np.abs(mean_u[excited])
    freedom = (count - 1) * (1.0 + odd / (variance[excited] / count + 1e-300))
    power = np.abs(mean_y[excited]) ** 2
    return Lines(
        method="multisine",
        frequency=excited / (periods.length * aligned.period),
        response=mean_y[excited] / mean_u[excited],
        sd=widen(spread, np.minimum(freedom, count - 1 + _SMOOTHED)),
        coherence=power / (power + variance[excited] + 1e-300),
        noise=levels.noise * np.sqrt(count),
        distortion=levels.total,
    )


def excited_lines(mean_u: ComplexArray) -> IntArray:
    """Return the lines that hold command: within 40 dB of the strongest, without the mean."""
    size = np.abs(mean_u)
    size[0] = 0.0
    return np.flatnonzero(size > _EXCITED * size.max())


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
        result: FloatArray = rms * np.sqrt(np.maximum(np.interp(excited, at, beyond), 0.0))
        return result

    noise = np.interp(excited, lines, _smooth(variance[lines]))
    return Distortion(rms * np.sqrt(noise), level(silent[silent % 2 == 0]), level(silent[silent % 2 == 1]))


def _smooth(values: FloatArray) -> FloatArray:
    """Return the running mean over _SMOOTHED lines."""
    if len(values) < _SMOOTHED:
        return np.full(len(values), values.mean())
    padded = np.pad(values, _SMOOTHED // 2, mode="edge")
    smooth: FloatArray = np.convolve(padded, np.full(_SMOOTHED, 1.0 / _SMOOTHED), mode="valid")
    return smooth


HIGHEST = 0.45
"""Of the sample rate: above it an image is as large as the response itself."""


def estimate_response(record: Record, output: str, input: str = "command") -> FrequencyResponse:
    """Return output per input. An input that is itself measured counts through the command, which no sensor
    noise reaches: (output / command) / (input / command).

    Raises ChannelError for a missing channel and IdentificationError for one too short.
    """
    response = _per_command(record, output)
    if input == "command":
        return response
    return _ratio(response, _per_command(record, input))


def sampled_lines(aligned: Aligned) -> Lines:
    """Return the sampled response by the method that the command allows."""
    periods = find_periods(aligned.command)
    if periods is not None:
        return multisine(aligned, periods)
    return welch(aligned) if suits(aligned) else local_polynomial(aligned)


def _per_command(record: Record, output: str) -> FrequencyResponse:
    aligned = align(record, output)
    lines = sampled_lines(aligned).up_to(HIGHEST * min(1.0 / aligned.period, aligned.rate))
    response, sd = unfold(aligned, lines.frequency, lines.response, lines.sd)
    return FrequencyResponse(
        input="command",
        output=output,
        frequency=lines.frequency,
        response=response,
        coherence=lines.coherence,
        sd=sd,
        method=lines.method,
        noise=lines.noise,
        distortion=lines.distortion,
    )


def _ratio(output: FrequencyResponse, input: FrequencyResponse) -> FrequencyResponse:
    """Return the quotient of two responses to the same command, on the lines of the first."""
    below, below_sd, below_coherence = (
        np.interp(output.frequency, input.frequency, v) for v in (input.response, input.sd, input.coherence)
    )
    response = output.response / below
    relative = np.hypot(output.sd / np.abs(output.response), below_sd / np.abs(below))
    coherence = np.minimum(output.coherence, below_coherence)
    return replace(
        output, input=input.output, response=response, sd=np.abs(response) * relative, coherence=coherence
    )


def responses_of(record: Record, rig: Rig) -> tuple[FrequencyResponse, ...]:
    """Return the measured responses of a record's sensors to the command, of those that move.

    A sensor that is too slow for every line of the command shows none.
    """
    outputs = [n for n in ("ft", "position", "deflection") if n in record and rig.measures(n)]
    if record["command"].is_still:
        return ()
    responses = []
    for name in (n for n in outputs if len(record[n]) >= FEWEST and not record[n].is_still):
        with suppress(AtRestError):
            responses.append(estimate_response(record, name))
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
        response = np.einsum("j,kj->k", _output_row(rig, output, system.mechanics), solved)
        plant = np.einsum("j,kj->k", encoder_row(rig, system.mechanics), solved)
        responses[output] = response if rig.loop is None else close_loop(rig, plant, response, s)
    return responses


def _output_row(rig: Rig, output: str, m: Mechanics) -> FloatArray:
    if output == "ft":
        return rig["spring.stiffness"] * read_row(rig, m, st.DEFLECTION) + rig["spring.damping"] * read_row(
            rig, m, st.DEFLECTION_RATE
        )
    if output == "deflection":
        return read_row(rig, m, st.DEFLECTION)
    return encoder_row(rig, m, is_rate=output == "velocity")
