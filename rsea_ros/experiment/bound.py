"""The most that any run could separate two hypotheses: a proof where it is next to nothing.

A run is a mixture in time of sines of the band, at several amplitudes and biases within the limits. If one
set of the rival's values leaves, of every sine, at most a power p over the noise, no mixture of length T
separates by more than S = p T, whatever its spectrum: the refit can only do better than these values. The
values are chosen to make the largest p smallest (Lawson's weights: each sine weighted by its residual
so far). For linear rigs every spectrum is such a mixture; for others the bound covers the sines tried.
(Duality of the optimal design: Fedorov, Theory of Optimal Experiments, 1972.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.experiment.hypothesis import Hypothesis, motion, run_case
from rsea_ros.experiment.run_limits import RunLimits, largest_share, of_command, of_response
from rsea_ros.identification.excitation import ramp_ends
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, serial, solve
from rsea_ros.records.record import FloatArray

_LENGTH = 1.0
"""s of a sine, of which the first is left to settle by its ramp; low frequencies get a period."""
_LEVELS = ((1.0, 0.0), (0.3, 0.0), (0.4, 0.5))
"""Amplitude and bias of the sines, as shares of what the limits allow."""
_FREQUENCIES = 8
_LAWSON = 3
_ITERATIONS = 8
HOPELESS = 6.0
"""S of the longest run below which it would not make the odds twenty to one."""


@dataclass(frozen=True)
class Bound:
    """A bound for every run.

    true, rival: names. most: S of a run of `duration` s, of any spectrum in the band.
    frequency: Hz, rate: S a second at the worst level, shape (k,). values: the rival's, by name, SI, with
    which it imitates the true one best.
    """

    true: str
    rival: str
    most: float
    duration: float
    frequency: FloatArray
    rate: FloatArray
    values: Mapping[str, float]

    @property
    def is_hopeless(self) -> bool:
        """Whether no run of that length separates the two."""
        return self.most < HOPELESS


def bound(
    true: Hypothesis,
    rival: Hypothesis,
    limits: RunLimits,
    duration: float,
    noise: Mapping[str, float],
    rate: float = 280.0,
    run: Map = serial,
) -> Bound:
    """Return the most that a run of `duration` s separates two hypotheses. noise: by channel. rate: Hz."""
    frequencies = np.geomspace(0.5, 0.4 * rate, _FREQUENCIES)
    sines = [(f, _sine(float(f), level, true, limits, rate)) for f in frequencies for level in _LEVELS]
    problem = replace(true.problem, cases=tuple(run_case(u, rate, noise) for _, u in sines))
    outputs = problem.outputs(true.if_there())
    cases = tuple(replace(c, measured=dict(o)) for c, o in zip(problem.cases, outputs, strict=True))
    theta, powers = _imitate(replace(rival.problem, cases=cases), rival.theta, duration, run)
    at = np.array([f for f, _ in sines])
    worst = np.array([powers[at == f].max() for f in frequencies])
    values = {u.name: u.outer(float(v)) for u, v in zip(rival.problem.unknowns, theta, strict=True)}
    return Bound(true.name, rival.name, float(worst.max()) * duration, duration, frequencies, worst, values)


def _sine(
    frequency: float, level: tuple[float, float], true: Hypothesis, limits: RunLimits, rate: float
) -> FloatArray:
    """Return a sine of a level within the limits at the likeliest values, N m."""
    length = max(_LENGTH, 1.0 / frequency)
    t = np.arange(round(length * rate)) / rate
    amplitude, bias = level
    command = limits.torque * ramp_ends(
        bias + amplitude * np.sin(2.0 * np.pi * frequency * t), round(0.2 * rate)
    )
    rig = true.rig_at(true.if_there())
    for _ in range(3):
        peaks = of_command(command, rate) | of_response(command, motion(rig, command, rate))
        share = largest_share(peaks, limits)
        if share <= 1.0:
            break
        command = command * (0.98 / share if np.isfinite(share) else 0.3)
    return command


def _imitate(
    problem: Problem, theta: FloatArray, duration: float, run: Map
) -> tuple[FloatArray, FloatArray]:
    """Return the values that imitate best, and the S a second that they leave, shape (cases,)."""
    weights = np.full(len(problem.cases), 1.0)
    best, least = theta, _powers(problem, theta)
    for _ in range(_LAWSON):
        heavy = replace(problem, cases=tuple(map(_with_weight, problem.cases, (weights * duration).tolist())))
        theta = solve(heavy, best, iterations=_ITERATIONS, run=run).theta
        powers = _powers(problem, theta)
        if powers.max() < least.max():
            best, least = theta, powers
        weights = weights * np.sqrt(powers + 1e-12 * powers.max() + 1e-300)
        weights = weights / weights.mean()
    return best, least


def _with_weight(case: Case, weight: float) -> Case:
    return replace(case, noise={n: v / np.sqrt(max(weight, 1e-6)) for n, v in case.noise.items()})


def _powers(problem: Problem, theta: FloatArray) -> FloatArray:
    outputs = problem.outputs(theta)
    return np.array([_power(problem, c, o) for c, o in zip(problem.cases, outputs, strict=True)])


def _power(problem: Problem, case: Case, outputs: Mapping[str, FloatArray]) -> float:
    """Return the squared residual of a case over the noise, summed, per second."""
    parts: Sequence[float] = [
        float(np.sum(((outputs[n] - case.measured[n]) / case.noise[n]) ** 2)) for n in problem.present(case)
    ]
    return sum(parts) / case.duration
