"""A proposed run, and the chance that it breaks a limit.

For each cause that may be true, the largest of every limited quantity is simulated at the most likely values
and at both ends of every principal axis of their posterior, z standard deviations away, and half-way
to them. The increases add up as squares: for a peak linear in the values that is the quantile of
z, for another one the simulated ends count. A cause with several parameters is also simulated with these
moved together, and at draws from its posterior. z is such that all causes together, each by its probability,
break a limit with less than 1 - LEVEL. (First-order reliability: Hasofer, Lind, J. Eng. Mech. 100, 1974.)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import ndtri  # norm.isf, without the 0.3 s of scipy.stats

from rsea_ros.errors import ParameterError
from rsea_ros.experiment import run_shape
from rsea_ros.experiment.hypothesis import Hypothesis, motion
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

LEVEL = 1.0 - 1e-5
"""Probability with which all limits hold, over the causes and what is known of their numbers."""
_POINTS = 4
"""On each axis: both ends and half-way to them, for a stop is struck hardest somewhere in between."""
_LEVELS = 33
"""Of a cause's size within its bounds, where its other parameters are moved with it."""
_DRAWS = 64
"""Rigs drawn from the posterior of a cause with several parameters."""
_LIKELIEST = 0.01
"""Share of its benches in which even the least likely cause may break a limit."""
BETWEEN = 1.02
"""What a peak between two samples may have above them."""


@dataclass(frozen=True)
class Group:
    """Rigs of one hypothesis: the first `axes` on the axes; in the others its parameters move together."""

    rigs: tuple[Rig, ...]
    axes: int


@dataclass(frozen=True)
class Peaks:
    """The largest of every quantity in a run: expected at the most likely values, and at LEVEL."""

    expected: dict[str, float]
    at_level: dict[str, float]


def ends_of(hypotheses: Sequence[Hypothesis]) -> list[Group]:
    """Return for each hypothesis its most likely rig, the points of every axis, and those moved together.

    A less likely one may break a limit more often: its points are nearer.
    """
    allowed = [(1.0 - LEVEL) / (len(hypotheses) * max(h.probability, 1e-9)) for h in hypotheses]
    quantiles = [float(-ndtri(min(max(a, 1.0 - LEVEL), _LIKELIEST))) for a in allowed]
    pairs = list(zip(hypotheses, quantiles, strict=True))
    axes = [[*_ends(h, z)] for h, z in pairs]
    return [Group((*a, *_corners(*pair)), len(a)) for a, pair in zip(axes, pairs, strict=True)]


def _ends(hypothesis: Hypothesis, z: float) -> Iterator[Rig]:
    unknowns, theta = hypothesis.problem.unknowns, hypothesis.theta
    moving = [i for i, u in enumerate(unknowns) if not u.is_clock]
    covariance = np.linalg.inv(hypothesis.information)[np.ix_(moving, moving)]
    sd = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sd, sd))
    yield hypothesis.rig
    for value, vector in zip(values, vectors.T, strict=True):
        for side in (-z, -0.5 * z, 0.5 * z, z):
            moved = theta.copy()
            moved[moving] += side * np.sqrt(max(value, 0.0)) * vector * sd
            yield hypothesis.rig_at(moved)


def _corners(hypothesis: Hypothesis, z: float) -> Iterator[Rig]:
    """Return rigs with the cause's own parameters moved together, and some drawn from the posterior.

    A near stop is worst where it is stiff, at some distances more than at those beside them, and where the
    rest damps little.
    """
    positions, sd = hypothesis.cause_indices[:3], hypothesis.sd()
    if len(positions) < 2:
        return
    main = positions[0]
    low, high = ((bounds - hypothesis.theta)[main] / (z * sd[main]) for bounds in hypothesis.bounds())
    sizes = np.linspace(max(-1.0, low), min(1.0, high), _LEVELS)
    for corner in product(sizes, *[(-1.0, 0.0, 1.0)] * (len(positions) - 1)):
        moved = hypothesis.theta.copy()
        moved[positions] += z * np.array(corner) * sd[positions]
        yield hypothesis.rig_at(moved)
    yield from hypothesis.draws(_DRAWS, np.random.default_rng(0))


def peaks(command: FloatArray, rate: float, groups: Sequence[Group]) -> Peaks:
    """Return the peaks of a command over the groups of ends_of."""
    by_command = run_shape.of_command(command, rate)
    expected, at_level = dict(by_command), dict(by_command)
    for group in groups:
        runs = [run_shape.of_response(command, motion(rig, command, rate)) for rig in group.rigs]
        for name in runs[0]:
            values = BETWEEN * np.array([run[name] for run in runs])
            expected[name] = max(expected.get(name, 0.0), float(values[0]))
            level = at_ends(values[: group.axes])
            together = float(values.max()) if np.isfinite(values).all() else np.inf
            at_level[name] = max(at_level.get(name, 0.0), level, together)
    return Peaks(expected, at_level)


def at_ends(values: FloatArray) -> float:
    """Return the peak at the quantile: in the middle, then at the points of each axis, shape (1 + 4 k,)."""
    if not np.isfinite(values).all():
        return np.inf
    increases = np.maximum(values[1:].reshape(-1, _POINTS).max(axis=1) - values[0], 0.0)
    return float(values[0] + np.sqrt(np.sum(increases**2)))


RATES = (50.0, 1000.0)
"""Hz, least and most commands a second: the rates of the nodes that play a run."""
LONGEST = 600.0
"""s, of a run at most."""


@dataclass(frozen=True)
class DesignRequest:
    """The freedom of a design. rate: Hz. shortest, longest: s. refine: evaluations of the refinement.

    per_run: s of excitation that are as dear as one more run; little of it makes more and shorter runs.
    test: 0 for a run that decides between all causes; else the run is a test, which is to show the others
    although the first seems known: chance with which it must show them to be preferred to a longer one.
    Raises ParameterError for a rate outside RATES and for lengths that no run can have.
    """

    limits: run_shape.RunLimits
    rate: float = 280.0
    shortest: float = 0.5
    longest: float = 10.0
    probe: float = 2.0
    refine: int = 24
    kinds: tuple[run_shape.Kind, ...] = ("multisine", "chirp", "steps", "holds")
    per_run: float = 0.5
    test: float = 0.0

    def __post_init__(self) -> None:
        low, high = RATES
        if not low <= self.rate <= high:
            raise ParameterError(f"rate = {self.rate:g} Hz, expected {low:g} to {high:g} Hz")
        if not self.longest <= LONGEST:
            raise ParameterError(f"longest run {self.longest:g} s, expected at most {LONGEST:g} s")
        if not 0.0 < self.shortest <= self.longest:
            raise ParameterError(
                f"longest run {self.longest:g} s, expected at least the shortest of {self.shortest:g} s"
            )
        if self.longest * self.rate < (fewest := max(run_shape.FEWEST.values())):
            run = f"longest run {self.longest:g} s at {self.rate:g} Hz"
            raise ParameterError(f"{run}, expected at least {fewest} samples")


@dataclass(frozen=True)
class Proposal:
    """A run to be played, and its expected results.

    duration: s, of the excitation; command: N m, at `rate` Hz, shape (n,), with rest around it. names,
    table: S_ij with i true and j its rival. hopeless: pairs that no shape tried separates. decided: expected
    share that it decides, in a test of the cases in which the first cause is not true; chances: that it
    decides, for each name, were it true; resolved: share that it decides of what is undecided without it and
    some run separates; sharpened: nats by which it narrows the parameters where one cause is left. peaks: of
    every quantity. tried: shapes that were rated. energy: N^2 m^2 s, the integral of the squared command.
    """

    shape: run_shape.Shape
    duration: float
    rate: float
    command: FloatArray
    names: tuple[str, ...]
    table: FloatArray
    hopeless: tuple[tuple[str, str], ...]
    decided: float
    chances: tuple[float, ...]
    resolved: float
    sharpened: float
    peaks: Peaks
    tried: int
    energy: float

    @property
    def worst(self) -> tuple[str, str, float] | None:
        """The pair that it separates least of those that can be, with its S; None for a single cause."""
        table = self.table.copy()
        for pair in self.hopeless:
            i, j = (self.names.index(n) for n in pair)
            table[i, j] = table[j, i] = np.inf
        if not np.isfinite(table).any():
            return None
        i, j = divmod(int(np.argmin(table)), len(table))
        return self.names[i], self.names[j], float(table[i, j])
