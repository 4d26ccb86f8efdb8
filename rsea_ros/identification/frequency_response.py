"""Frequency responses of a record from the command to each channel.

A command that repeats is analysed by its periods, a long random one by averaged segments, anything else by
local polynomials. All give continuous-time responses: hold, acquisition instants and folded images are
taken out (unfold.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from rsea_ros.effects import signal_table as st
from rsea_ros.identification.local_polynomial import Lines, local_polynomial
from rsea_ros.identification.multisine import find_periods, multisine
from rsea_ros.identification.problem import FEWEST
from rsea_ros.identification.resample import Aligned, AtRestError, align
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.identification.welch import suits, unfold, welch
from rsea_ros.model.equations import Mechanics
from rsea_ros.model.position_loop import close_loop
from rsea_ros.model.propagator import encoder_row, read_row, state_space
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray, Record

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
