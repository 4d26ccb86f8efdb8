"""How far a run separates two hypotheses: shapes within the limits, simulated, fitted and rated.

S_ij = min_d ||y_j + J_j d - y_i||^2 + d' L_j d

y: predictions over the noise; J_j: derivatives of the rival's; L_j: its information so far. S_ij / 2 is the
expected gain of the logarithm of the odds of i over j where i is true: T-optimality (Atkinson, Fedorov,
Biometrika 62, 1975), averaged over which is true (Ponce de Leon, Atkinson, Biometrika 78, 1991).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from rsea_ros.experiment.hypothesis import Hypothesis, Response, response, run_case
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_shape import FEWEST, Shape, command_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import Map, descend, jacobian, power, serial
from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import MEASURED, BoolArray, FloatArray

INSIDE = 0.9
"""Share of the limits that shapes use during the search, where only the likeliest values are simulated."""


@dataclass(frozen=True)
class ShapeRater:
    """Rates shapes for hypotheses. noise: by channel."""

    hypotheses: Sequence[Hypothesis]
    asked: DesignRequest
    noise: Mapping[str, float]
    run: Map

    def within(self, shape: Shape, duration: float) -> FloatArray:
        """Return the command of a shape in shares, as large as the limits allow at the likeliest values."""
        limits, rate = self.asked.limits, self.asked.rate
        whole = abs(shape.bias) + shape.amplitude
        size = limits.torque * min(1.0, 1.0 / whole) * INSIDE
        scaled = replace(shape, amplitude=shape.amplitude * size, bias=shape.bias * size)
        command = command_of(scaled, duration, rate, limits.slew)
        for _ in range(3):
            share = max(h.share_of(limits, command, rate) for h in self.hypotheses)
            if share <= INSIDE * 1.05:
                break
            command = command * (INSIDE / share if math.isfinite(share) else 0.5)
        return command

    def responses(self, command: FloatArray, *, is_quick: bool = True) -> list[Response]:
        """Return the prediction of each hypothesis for a command."""
        case = self.case(command, is_quick=is_quick)
        return [response(h, case, self.run) for h in self.hypotheses]

    def case(self, command: FloatArray, *, is_quick: bool) -> Case:
        """Return a run of a command, not yet made."""
        return run_case(command, self.asked.rate, self.noise, is_quick=is_quick)


def noise_by_channel(hypotheses: Sequence[Hypothesis], measured: Mapping[str, float]) -> dict[str, float]:
    """Return the noise of every channel that the bench measures: as measured, else as the rig states it."""
    rig = hypotheses[0].problem.rig
    listed = [n for n in MEASURED if n in (measured or rig.sensors) and rig.measures(n)]
    stated = {n: max(rig.sensors.get(n, Sensor()).level, 1e-9) for n in listed or ["ft", "position"]}
    return {n: measured.get(n, level) for n, level in stated.items()}


SURE = float(np.log(19.0))
"""Logarithm of the odds that confirm a cause: 0.95 to 0.05."""


def separation(true: FloatArray, rival: Response, information: FloatArray) -> float:
    """Return S of a rival, with the priors of its numbers, where the prediction `true` is, shape (m,)."""
    difference = rival.predicted - true
    if not np.isfinite(difference).all():
        return 0.0
    slope = rival.slope.T @ difference
    reached = np.linalg.solve(rival.slope.T @ rival.slope + information, slope)
    return max(float(difference @ difference - slope @ reached), 0.0)


def separations(hypotheses: Sequence[Hypothesis], responses: Sequence[Response]) -> FloatArray:
    """Return S_ij where i is true and j its rival, shape (k, k); infinite on the diagonal."""
    return np.array([_row(r.if_there, i, hypotheses, responses) for i, r in enumerate(responses)])


def likely_separations(hypotheses: Sequence[Hypothesis], responses: Sequence[Response]) -> list[FloatArray]:
    """Return for each hypothesis its rows of S with each of its likely values, shape (m, k) each."""
    return [
        np.array([_row(true, i, hypotheses, responses) for true in r.likely]) for i, r in enumerate(responses)
    ]


def _row(
    true: FloatArray, i: int, hypotheses: Sequence[Hypothesis], responses: Sequence[Response]
) -> FloatArray:
    rivals = enumerate(zip(responses, hypotheses, strict=True))
    return np.array([np.inf if i == j else separation(true, r, h.information) for j, (r, h) in rivals])


@dataclass(frozen=True)
class Refit:
    """A rival fitted to the prediction of another.

    total: S; data: its part from the run, which alone grows with its length.
    """

    total: float
    data: float


_REFITS = 5


def refit(true: Hypothesis, rival: Hypothesis, case: Case, run: Map = serial) -> Refit:
    """Return S of a rival after a full fit: where values have to go far, one linear step leaves too much.

    case: the run, as run_case makes it. Gauss-Newton from the rival's values, steps halved where they fail.
    """
    predicted = replace(true.problem, cases=(case,)).outputs(true.if_there())[0]
    problem = replace(rival.problem, cases=(replace(case, measured=predicted),))
    low, high = rival.bounds()
    end = descend(
        lambda theta: problem.residual(np.clip(theta, low, high)),
        lambda theta, r: jacobian(problem, theta, r, run),
        rival.theta, rival.information, rounds=_REFITS, enough=0.01,
        parts=(1.0, 0.3, 0.09, 0.027),
    )  # fmt: skip
    return Refit(end.cost, power(end.residual))


def chances_decided(
    hypotheses: Sequence[Hypothesis], rows: Sequence[FloatArray], apart: BoolArray
) -> FloatArray:
    """Return for each hypothesis, if it is true, the chance that a run decides it, shape (k,).

    That its log odds over the worst rival reach SURE: they become normal, with mean
    ln(p_i / p_j) + S_ij / 2 and variance S_ij. The mean over its likely values. rows: as
    likely_separations. apart: pairs that no run separates, shape (k, k).
    """
    odds = np.log(np.maximum([h.probability for h in hypotheses], 1e-300))
    return np.array([_chance(odds[i] - odds, rows[i], apart[i]) for i in range(len(rows))])


def _chance(odds: FloatArray, rows: FloatArray, apart: BoolArray) -> float:
    counts = np.isfinite(rows[0]) & ~apart
    if not counts.any():
        return 0.0
    s = np.maximum(rows[:, counts], 1e-12)
    return float(np.mean(ndtr(((odds[counts] + 0.5 * s - SURE) / np.sqrt(s)).min(axis=1))))


def information_gain(hypothesis: Hypothesis, seen: Response) -> float:
    """Return the nats by which a run narrows a cause's own parameters, all others free (D-optimality).

    Half the logarithm of the ratio of the determinants of their information after and before.
    """
    indices = hypothesis.cause_indices or list(range(len(hypothesis.theta)))
    before = np.linalg.inv(hypothesis.information)[np.ix_(indices, indices)]
    after = np.linalg.inv(hypothesis.information + seen.slope.T @ seen.slope)[np.ix_(indices, indices)]
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])


_TRIED: tuple[Shape, ...] = (
    Shape("multisine", 1.0, low=0.5, high=8.0),
    Shape("multisine", 1.0, low=0.5, high=40.0, tilt=0.5),
    Shape("multisine", 1.0, low=2.0, high=25.0),
    Shape("multisine", 1.0, low=10.0, high=100.0),
    Shape("multisine", 0.5, bias=0.5, low=0.5, high=25.0),
    Shape("multisine", 0.3, low=0.5, high=40.0, tilt=0.5),
    Shape("chirp", 1.0, low=0.3, high=30.0),
    Shape("chirp", 1.0, low=2.0, high=100.0),
    Shape("steps", 1.0, hold=0.03),
    Shape("steps", 1.0, hold=0.1),
    Shape("steps", 1.0, hold=0.3),
    Shape("holds", 1.0, hold=0.15),
    Shape("steps", 0.3, bias=0.5, hold=0.2),
)
"""Where the search begins; amplitude and bias as shares of what the limits allow."""
_LEAST = 0.05
"""Share that a run must be expected to decide to be preferred to a longer one."""


@dataclass(frozen=True)
class Trial:
    """A shape of a length (s), the share that it is expected to decide, the least S of the likeliest two."""

    share: float
    length: float
    shape: Shape
    least: float

    def per_second(self, per_run: float) -> float:
        """Return the share that it decides per second; per_run: s that one more run costs."""
        return self.share / (per_run + self.length)


def shapes_for(asked: DesignRequest) -> list[Shape]:
    """Return the shapes from which the search for a run begins."""
    return [s for s in _TRIED if s.kind in asked.kinds]


def least_share(asked: DesignRequest) -> float:
    """Return the share that a run must be expected to decide to be preferred to a longer one."""
    return asked.test or _LEAST


def try_lengths(rater: ShapeRater, shapes: Sequence[Shape], apart: BoolArray, shortest: float) -> list[Trial]:
    """Return the shapes of every length from some seconds, up to one that could not be worth its seconds."""
    asked, trials = rater.asked, list[Trial]()
    doublings = math.ceil(math.log2(asked.longest / shortest))
    for seconds in np.geomspace(shortest, asked.longest, doublings + 1):
        length = float(np.rint(seconds * asked.rate) / asked.rate)
        best = best_of(trials, asked) if trials else None
        most = 1.0 / (asked.per_run + length)  # that a run of this length can decide per second
        if best and best.share >= least_share(asked) and best.per_second(asked.per_run) > most:
            break
        possible = [s for s in shapes if length * asked.rate >= FEWEST[s.kind]]
        trials += [trial_of(rater, s, length, apart) for s in possible]
    return trials


def best_of(trials: Sequence[Trial], asked: DesignRequest) -> Trial:
    """Return the trial that decides most per second; where none decides enough, the one that decides most.

    Of several that decide nothing the longest, with the largest S of the likeliest two.
    """
    enough = [t for t in trials if t.share >= least_share(asked)]
    if not enough:
        return max(trials, key=lambda t: (t.share, t.length, t.least))
    return max(enough, key=lambda t: t.per_second(asked.per_run))


def trial_of(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray) -> Trial:
    """Return a shape of a length (s), rated. apart: pairs that no run separates, shape (k, k)."""
    rows = likely_separations(rater.hypotheses, rater.responses(rater.within(shape, length)))
    share = share_decided(rater, chances_decided(rater.hypotheses, rows, apart))
    first, second = sorted(range(len(rows)), key=lambda k: -rater.hypotheses[k].probability)[:2]
    least = min(float(rows[first][:, second].mean()), float(rows[second][:, first].mean()))
    return Trial(share, length, shape, least)


def share_decided(rater: ShapeRater, chances: FloatArray) -> float:
    """Return the share of the cases that a run is expected to decide; in a test, of those it is for."""
    first = 1 if rater.asked.test else 0
    probability = np.array([h.probability for h in rater.hypotheses[first:]])
    return float(probability @ chances[first:] / max(probability.sum(), 1e-300))
