"""The start of a fit: the rig's values fitted to the measured frequency responses.

An output error of hundreds of times the noise has many minima; the logarithm of a response has hardly any,

    r = ln(G_model / G_measured) / w,   w^2 = (sd / |G|)^2 + 0.05^2

so a rig that is far off still converges. The result only starts the fit and decides nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rsea_ros.identification.responses import model_response
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.identification.unknowns import apply, start_vector, unknowns_of_rig
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

_LINES = 60
"""Of each response, evenly spread on a logarithmic scale."""
_COHERENT = 0.5
_MODEL_ERROR = 0.05
_DIFFERENCE = 1e-4
_ITERATIONS = 15


def start_from(responses: Sequence[FrequencyResponse], rig: Rig) -> Rig:
    """Return the rig with free values that bring its linear responses near the measured ones."""
    unknowns, chosen = unknowns_of_rig(rig), [r for r in map(_choose_lines, responses) if len(r.frequency)]
    if not (unknowns and chosen):
        return rig
    begin = start_vector(unknowns)
    doubt = np.array([u.reach for u in unknowns])

    def residual(theta: FloatArray) -> FloatArray:
        moved, _ = apply(rig, unknowns, theta)
        return np.concatenate([*(_misfit(r, moved) for r in chosen), (theta - begin) / doubt])

    return apply(rig, unknowns, _least_squares(residual, begin))[0]


def _choose_lines(response: FrequencyResponse) -> FrequencyResponse:
    """Return the lines that count, few enough to be quick."""
    good = np.flatnonzero(
        (response.coherence > _COHERENT) & np.isfinite(response.sd) & (response.frequency > 0.0)
    )
    if len(good) > _LINES:
        wanted = np.geomspace(response.frequency[good[0]], response.frequency[good[-1]], _LINES)
        good = good[np.unique(np.searchsorted(response.frequency[good], wanted).clip(0, len(good) - 1))]
    return FrequencyResponse(
        input=response.input,
        output=response.output,
        frequency=response.frequency[good],
        response=response.response[good],
        coherence=response.coherence[good],
        sd=response.sd[good],
        method=response.method,
    )


def _misfit(measured: FrequencyResponse, rig: Rig) -> FloatArray:
    quotient = np.log(model_response(rig, measured.output, measured.frequency) / measured.response)
    weight = np.hypot(measured.sd / np.abs(measured.response), _MODEL_ERROR)
    return np.concatenate([quotient.real / weight, quotient.imag / weight])


def _least_squares(residual: Callable[[FloatArray], FloatArray], theta: FloatArray) -> FloatArray:
    """Return theta at the least sum of squares: Gauss-Newton, the step halved until it helps."""
    misfit = residual(theta)
    for _ in range(_ITERATIONS):
        steps = _DIFFERENCE * np.eye(len(theta))
        slope = np.column_stack([(residual(theta + s) - misfit) / _DIFFERENCE for s in steps])
        step = -np.linalg.lstsq(slope, misfit, rcond=None)[0]
        trials = ((theta + f * step, residual(theta + f * step)) for f in (1.0, 0.5, 0.25, 0.1, 0.03))
        better = next((t for t in trials if t[1] @ t[1] < misfit @ misfit), None)
        if better is None:
            break
        done = misfit @ misfit - better[1] @ better[1] < 1e-3 * (misfit @ misfit)
        theta, misfit = better
        if done:
            break
    return theta
