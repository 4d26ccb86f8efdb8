"""Parameters as estimates with intervals, and those that are off what the rig states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.documents.units import in_motion
from rsea_ros.identification.confidence import Confidence, interval
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.result import CLOCKS, IDENTIFIABLE_SHARE, Overlay, ParameterEstimate, Remark
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import apply
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray


def errors_by_channel(
    problem: Problem, outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return by channel the error (simulated - measured) and the measured values, of samples that count."""
    parts: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for case, out in zip(problem.cases, outputs, strict=True):
        for n in problem.present(case):
            keep, y = case.mask[n], case.measured[n]
            parts.setdefault(n, []).append(((out[n] - y)[keep], y[keep]))
    return {
        n: (np.concatenate([e for e, _ in p]), np.concatenate([y for _, y in p])) for n, p in parts.items()
    }


def parameters_of(solution: Solution, confidence: Confidence) -> tuple[ParameterEstimate, ...]:
    """Return the estimates of a fit with their 95 % intervals."""
    sd = np.sqrt(np.diag(confidence.covariance))
    return tuple(
        ParameterEstimate(
            name=u.name,
            value=u.outer(float(theta)),
            unit=in_motion(u.unit, linear=solution.problem.rig.linear),
            ci95=interval(u, float(theta), float(s)),
            start=u.start,
            spread=u.spread,
            told_by_data=float(share),
            spreads_off=u.sigmas(float(theta)),
        )
        for u, theta, s, share in zip(
            solution.problem.unknowns, solution.theta, sd, confidence.data_share, strict=True
        )
    )


def identified_rig(solution: Solution, parameters: Sequence[ParameterEstimate]) -> Rig:
    """Return the rig with the fitted values, their intervals, and their doubt as the next fit's spread."""
    rig, clocks = apply(solution.problem.rig, solution.problem.unknowns, solution.theta)
    sensors = {
        n: replace(
            s, clock=s.clock + clocks.offset.get(n, 0.0), clock_rate=s.clock_rate + clocks.rate.get(n, 0.0)
        )
        for n, s in rig.sensors.items()
    }
    quantities = dict(rig.quantities)
    for estimate in parameters:
        if estimate.name in quantities:
            quantities[estimate.name] = replace(
                quantities[estimate.name], ci95=estimate.ci95, source="identified"
            )
    return replace(rig, quantities=quantities, sensors=sensors)


def overlays_of(case: Case, outputs: Mapping[str, FloatArray]) -> tuple[Overlay, ...]:
    """Return measured beside simulated for every channel of a case."""
    return tuple(Overlay(n, case.t[n], case.measured[n], outputs[n]) for n in outputs)


FAR = 3.0
"""Stated spreads of a value: one right rig in 400 lies further off by chance."""


def is_off(spreads: float, told_by_data: float) -> bool:
    """Return whether a value is surely not the rig's: far from it, and determined by the data."""
    return abs(spreads) > FAR and told_by_data >= IDENTIFIABLE_SHARE


def is_off_rig(solution: Solution) -> bool:
    """Return whether a fit has taken some value of the rig that far, determined by the data or not."""
    stated = solution.problem.rig.free()
    unknowns = zip(solution.problem.unknowns, solution.theta, strict=True)
    return any(u.name in stated and u.sigmas(float(t)) > FAR for u, t in unknowns)


def off_rig(parameters: Iterable[ParameterEstimate]) -> tuple[Remark, ...]:
    """Return a remark for each value that the data put far from the value of the rig."""
    return tuple(
        Remark("off_rig", (p.name,), (p.start, p.value, *p.ci95, p.spreads_off), p.unit)
        for p in parameters
        if not p.name.startswith(CLOCKS) and is_off(p.spreads_off, p.told_by_data)
    )
