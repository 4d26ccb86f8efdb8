"""Frequency responses of the continuous plant to the held command, by the method that the record allows.

A command that repeats is analysed by its periods, a long random one by averaged segments, anything else by
local polynomials. All give continuous-time responses: hold, acquisition instants and folded images are
taken out (unfold.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.identification.local_polynomial import local_polynomial
from rsea_ros.identification.multisine import multisine
from rsea_ros.identification.periodicity import find_periods
from rsea_ros.identification.resample import Aligned, align
from rsea_ros.identification.response_lines import Lines
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.identification.unfold import unfold
from rsea_ros.identification.welch import suits, welch
from rsea_ros.records.record import Record

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
