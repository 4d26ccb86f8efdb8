"""The frequency responses that a report shows: measured from the record, and of the fitted model."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from rsea_ros.effects import signal_table as st
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.identification.problem import FEWEST
from rsea_ros.identification.resample import AtRestError
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.equations import Mechanics
from rsea_ros.model.position_loop import close_loop
from rsea_ros.model.propagator import encoder_row, read_row, state_space
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray, Record


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
