"""The offline answer: the run to play, or the proof that none helps and the measurements to make instead.

A run is a mixture in time of sines of the band, at several amplitudes and biases within the limits. If one
set of the rival's values leaves, of every sine, at most a power p over the noise, no mixture of length T
separates by more than S = p T, whatever its spectrum: the refit can only do better than these values. The
values are chosen to make the largest p smallest (Lawson's weights: each sine weighted by its residual
so far). For linear rigs every spectrum is such a mixture; for others the bound covers the sines tried.
(Duality of the optimal design: Fedorov, Theory of Optimal Experiments, 1972.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis, run_case
from rsea_ros.experiment.proposal import DesignRequest, Proposal
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import RunLimits
from rsea_ros.experiment.separation import noise_by_channel
from rsea_ros.identification.excitation import ramp_ends
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Map, serial, solve
from rsea_ros.progress import Progress
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
    for _ in range(3):
        share = true.share_of(limits, command, rate)
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
        lighter = [np.sqrt(max(w, 1e-6)) for w in (weights * duration).tolist()]
        pairs = zip(problem.cases, lighter, strict=True)
        cases = (replace(c, noise={n: v / s for n, v in c.noise.items()}) for c, s in pairs)
        heavy = replace(problem, cases=tuple(cases))
        theta = solve(heavy, best, iterations=_ITERATIONS, run=run).theta
        powers = _powers(problem, theta)
        if powers.max() < least.max():
            best, least = theta, powers
        weights = weights * np.sqrt(powers + 1e-12 * powers.max() + 1e-300)
        weights = weights / weights.mean()
    return best, least


def _powers(problem: Problem, theta: FloatArray) -> FloatArray:
    """Return the squared residual of each case over the noise, summed, per second."""
    cases = zip(problem.cases, problem.outputs(theta), strict=True)
    left = [(c, [(made[n] - c.measured[n]) / c.noise[n] for n in problem.present(c)]) for c, made in cases]
    return np.array([sum(float(np.sum(r**2)) for r in residuals) / c.duration for c, residuals in left])


ACCURACY = 0.01
"""Relative, one sigma: what a value measured apart with care is worth."""
MOST = 2
_OF_VALUES: Mapping[str, str] = {
    "spring.stiffness": "the stiffness of the spring, by a known weight on a lever and the encoder",
    "rotor.reflected_inertia": "the inertia of the rotor, from its drawing or by a pendulum",
    "rotor.reflected_damping": "the drag of the motor, by its no-load current at a few speeds",
    "spring.damping": "the damping of the spring, by a free swing",
}
_OF_PORTS: Mapping[Port, str] = {
    Port.COMMAND: "the torque that the motor makes, by a torque sensor between motor and spring",
    Port.MOTOR: "the torque that the motor makes, by a torque sensor or a known weight held at rest",
    Port.GEAR: "the angle behind the gear, by a second encoder",
    Port.SPRING: "the deflection of the spring, by a second encoder",
    Port.SENSOR: "the F/T sensor, calibrated with a known weight",
    Port.STRUCTURE: "the motion of what gives, by an accelerometer or a dial gauge",
}


@dataclass(frozen=True)
class Apart:
    """A measurement apart. separation: S that it brings, None where that was not computed."""

    what: str
    separation: float | None = None


def measurements_apart(proved: Bound, true: Hypothesis, rival: Hypothesis) -> list[Apart]:
    """Return separate measurements: the sensors that show the causes, then at most MOST values of the rig.

    A value of the rig separates by how far the rival must have it from the true one to do what that does,
    over ACCURACY; of those that separate, the easiest to measure come first.
    """
    ours = {u.name: u.outer(float(v)) for u, v in zip(true.problem.unknowns, true.if_there(), strict=True)}
    values = []
    for name, theirs in proved.values.items():
        if name in true.problem.rig.quantities and ours[name] > 0.0 and theirs > 0.0:
            away = np.log(theirs / ours[name]) / ACCURACY
            values.append(Apart(_OF_VALUES.get(name, f"{name}, by itself"), float(away**2)))
    easy = [*_OF_VALUES.values()]
    values = [v for v in values if (v.separation or 0.0) > HOPELESS]
    values.sort(key=lambda v: easy.index(v.what) if v.what in easy else len(easy))
    effects = [effect_named(h.name) for h in (true, rival) if h.name != NOTHING]
    sensors = dict.fromkeys(_OF_PORTS[e.port] for e in effects)
    return [*(Apart(what) for what in sensors), *values[:MOST]]


LONGEST_OF_ALL = 60.0
"""s of a run in whose length a pair must be hopeless to be called so."""


@dataclass(frozen=True)
class Proof:
    """A pair that no run separates: the larger bound of both directions, and separate measurements.

    covers_all: every effect of both is linear, so that the bound by sines holds for any run.
    """

    bound: Bound
    apart: tuple[Apart, ...]
    covers_all: bool

    @property
    def pair(self) -> tuple[str, str]:
        """The two causes."""
        return self.bound.true, self.bound.rival


@dataclass(frozen=True)
class Advice:
    """proposal: the run, None where no run decides anything. proofs: of the pairs that none separates.
    excluded: causes that the records contradict, with their probability.
    """

    hypotheses: tuple[Hypothesis, ...]
    asked: DesignRequest
    proposal: Proposal | None
    proofs: tuple[Proof, ...]
    excluded: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return the causes and the length of the run in one line."""
        names = ", ".join(h.name for h in self.hypotheses)
        run = f"a run of {len(self.proposal.command) / self.asked.rate:g} s" if self.proposal else "no run"
        return f"Advice({names}: {run}, {len(self.proofs)} pairs that none separates)"


_WORTH = 0.02
"""Share of what is undecided that a run must decide to be worth playing."""


def advise(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float] | None = None,
    run: Map = serial,
    tell: Progress | None = None,
) -> Advice:
    """Return the run that separates hypotheses, and for pairs that no run separates the proof.

    measured: noise by channel. Raises ParameterError as propose does.
    """
    proposal = propose(hypotheses, asked, measured, run, tell)
    proofs = proofs_of(hypotheses, proposal.hopeless, asked, measured or {}, run)
    is_worth = len(hypotheses) == 1 or proposal.resolved > _WORTH
    return Advice(tuple(hypotheses), asked, proposal if is_worth else None, proofs)


def proofs_of(
    hypotheses: Sequence[Hypothesis],
    pairs: Sequence[tuple[str, str]],
    asked: DesignRequest,
    measured: Mapping[str, float],
    run: Map = serial,
) -> tuple[Proof, ...]:
    """Return the proofs for pairs that no run seems to separate; without those where one yet may."""
    named, noise = {h.name: h for h in hypotheses}, noise_by_channel(hypotheses, measured)
    proofs = [_prove(named[a], named[b], asked, noise, run) for a, b in pairs]
    return tuple(p for p in proofs if p is not None)


def _prove(
    a: Hypothesis, b: Hypothesis, asked: DesignRequest, noise: Mapping[str, float], run: Map
) -> Proof | None:
    """Return the proof that no run separates two, None where the bound leaves room for one."""
    both = [
        (i, j, bound(i, j, asked.limits, LONGEST_OF_ALL, noise, asked.rate, run)) for i, j in ((a, b), (b, a))
    ]
    true, rival, larger = max(both, key=lambda item: item[2].most)
    if larger.most >= HOPELESS:
        return None
    effects = [effect_named(e.name) for h in (a, b) for e in h.problem.rig.effects]
    is_linear = all(e.claims.amplitude_exponent == 1.0 for e in effects)
    return Proof(larger, tuple(measurements_apart(larger, true, rival)), is_linear)
