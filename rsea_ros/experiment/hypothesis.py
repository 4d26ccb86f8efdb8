"""A hypothesis: a model with causes, and which hypotheses contain others.

A cause may contain another if both act at the same place and have a size of the same unit. Its main parameter
is then that of the other, parameters of equal name are the same, and one that may be zero is what it adds.
The fit shows whether it does contain it: it begins at the other, and must fit no worse.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.run_shape import RunLimits, largest_share, of_command, of_response
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, jacobian, serial
from rsea_ros.identification.unknowns import apply, bounds_of
from rsea_ros.model.drive import coarser, drive_from
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import SENSED, Channel, FloatArray, Record

NOTHING = "nothing"
"""Name of the hypothesis that the rig, its values fitted, is all that there is."""


def may_contain(name: str, simpler: str) -> bool:
    """Return whether a cause may contain another of fewer parameters."""
    if NOTHING in (name, simpler) or name == simpler:
        return False
    effect, other = effect_named(name), effect_named(simpler)
    is_alike = effect.port == other.port and effect.main.unit == other.main.unit
    return is_alike and len(effect.parameters) > len(other.parameters)


def shared_parameters(name: str, simpler: str) -> dict[str, str]:
    """Return the parameters of a cause that are those of another, with the other's name for each."""
    effect, other = effect_named(name), effect_named(simpler)
    equal = {p.name for p in other.parameters} - {other.main.name}
    same = {p.name: p.name for p in effect.parameters if p.name in equal}
    return same | {effect.main.name: other.main.name}


def addition_to(name: str, simpler: str, unknowns: Sequence[str]) -> int | None:
    """Return the place of what a cause adds to another among the unknowns; None where it cannot contain it.

    unknowns: as `cause.parameter`.
    """
    if not may_contain(name, simpler):
        return None
    same = shared_parameters(name, simpler)
    for p in effect_named(name).parameters:
        is_added = p.name not in same and p.null == 0.0 and not p.logarithmic
        if is_added and f"{name}.{p.name}" in unknowns:
            return unknowns.index(f"{name}.{p.name}")
    return None


_SEEN = 3.0
"""Standard deviations from none at all, from which the size of a cause counts as known."""
_QUANTILES = np.array([-1.38, -0.67, -0.21, 0.21, 0.67, 1.38])
"""Of the normal distribution, in the middle of six equal shares."""


@dataclass(frozen=True)
class Hypothesis:
    """A cause that is still possible. See the module docstring.

    problem: the rig with the cause, and what may move; its cases do not matter. theta: the most likely
    values in the fit's coordinates, shape (n,). information: of prior and data so far, the inverse of the
    covariance, shape (n, n). probability: beside the other hypotheses. addition: which of the values is what
    the cause adds to the likeliest one, where it contains that; else None: its size is its main parameter.
    """

    name: str
    problem: Problem
    theta: FloatArray
    information: FloatArray
    probability: float
    addition: int | None = None

    @property
    def rig(self) -> Rig:
        """The rig with its most likely values."""
        return self.rig_at(self.theta)

    def rig_at(self, theta: FloatArray) -> Rig:
        """Return the rig with other values, in the fit's coordinates."""
        return apply(self.problem.rig, self.problem.unknowns, theta)[0]

    def sd(self) -> FloatArray:
        """Return the standard deviation of every unknown, in the fit's coordinates, shape (n,)."""
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(self.information))))

    def beside(self, simpler: str) -> Hypothesis:
        """Return the cause with what it adds to a simpler one as its size, if it may contain that one."""
        names = [u.name for u in self.problem.unknowns]
        return replace(self, addition=addition_to(self.name, simpler, names))

    def draws(self, count: int, rng: np.random.Generator) -> list[Rig]:
        """Return rigs whose values are drawn from their posterior."""
        factor = np.linalg.cholesky(np.linalg.inv(self.information))
        moved = self.theta + rng.standard_normal((count, len(self.theta))) @ factor.T
        return [self.rig_at(theta) for theta in moved]

    def if_there(self) -> FloatArray:
        """Return the values to be expected if the cause is present, shape (n,).

        The most likely ones; where its size may as well be zero, one standard deviation from zero, and the
        others as they correlate with it: a run is rated by what it would show of the cause.
        """
        if not self.cause_indices or not self._may_be_none():
            return self.theta
        away, sd = self._size()
        return np.asarray(self._with_size(np.array([np.copysign(max(sd - abs(away), 0.0), away)]))[0])

    def share_of(self, limits: RunLimits, command: FloatArray, rate: float) -> float:
        """Return the share of the limits that a command uses at the values to be expected. rate: Hz."""
        outputs = motion(self.rig_at(self.if_there()), command, rate)
        return largest_share(of_response(command, outputs) | of_command(command, rate), limits)

    def likely_values(self) -> FloatArray:
        """Return values that the cause may have if it is present, shape (m, n): equally likely sizes of it.

        The others as they correlate with its size.
        """
        if not self.cause_indices:
            return self.theta[None, :]
        away, sd = self._size()
        if not self._may_be_none():
            return self._with_size(sd * _QUANTILES.reshape(3, 2).mean(axis=1))
        sizes = np.sort(np.abs(abs(away) + sd * _QUANTILES)).reshape(3, 2).mean(axis=1)
        return self._with_size(np.copysign(sizes - abs(away), away))

    def _with_size(self, steps: FloatArray) -> FloatArray:
        """Return the values with the size of the cause moved by some steps, shape (m, n).

        What a cause adds takes the place of the rest of it, and stops where a parameter meets its bound;
        where that is at once, it goes the other way.
        """
        spread = np.linalg.inv(self.information)[:, self._main]
        moves = np.outer(steps, spread / spread[self._main])
        low, high = self.bounds()
        if self.addition is not None:
            share, back = self._room(moves), self._room(-moves)
            moves = np.where(share > 0.0, share, -back)[:, None] * moves
        return np.asarray(np.clip(self.theta + moves, low, high))

    def _room(self, moves: FloatArray) -> FloatArray:
        """Return how much of each move, up to 1, the bounds of the cause leave, shape (m,)."""
        (low, high), own = self.bounds(), self.cause_indices
        room = np.where(moves > 0.0, high - self.theta, self.theta - low)[:, own]
        size = np.abs(moves[:, own])
        return np.asarray(np.divide(room, size, np.ones_like(size), where=size > room).min(axis=1))

    @property
    def _main(self) -> int:
        """Where the size of the cause is among the values."""
        return self.cause_indices[0] if self.addition is None else self.addition

    def _may_be_none(self) -> bool:
        """Return whether the size of the cause may as well be none; on a logarithmic scale it never is."""
        away, sd = self._size()
        unknown = self.problem.unknowns[self._main]
        can_be = self.addition is not None or unknown.start == effect_named(self.name).main.null
        return can_be and abs(away) <= _SEEN * sd

    def _size(self) -> tuple[float, float]:
        """Return how far the size of the cause is from its prior's middle, and its standard deviation.

        Where its size is what it adds to another: how far from zero.
        """
        unknown = self.problem.unknowns[self._main]
        middle = unknown.start if self.addition is None else 0.0
        return float(self.theta[self._main] - unknown.inner(middle)), float(self.sd()[self._main])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the lowest and highest coordinates, shape (n,) each."""
        return bounds_of(self.problem.unknowns)

    @property
    def cause_indices(self) -> list[int]:
        """Where the cause's own parameters are among the unknowns."""
        names = [u.name for u in self.problem.unknowns]
        return [i for i, n in enumerate(names) if n.split(".")[0] == self.name]


@dataclass(frozen=True)
class Response:
    """The prediction of a hypothesis for a run, over the sensors' noise.

    if_there: with the values to be expected if it is true, shape (m,); likely: with each of its likely
    values, (k, m). predicted, slope: at its most likely values, (m,), with derivatives, (m, n), from which
    it is fitted where another is true.
    """

    if_there: FloatArray
    likely: FloatArray
    predicted: FloatArray
    slope: FloatArray


def run_case(command: FloatArray, rate: float, noise: Mapping[str, float], *, is_quick: bool = False) -> Case:
    """Return a run that was not made: a command, the channels that would be measured, all zero, their noise.

    is_quick: on steps twice as long.
    """
    t = np.arange(len(command)) / rate
    blank = {n: Channel(t + 1.0 / rate, np.zeros(len(t))) for n in noise}
    drive = drive_from(Record({"command": Channel(t, command), **blank}))
    drive = replace(drive, initial=(0.0, 0.0), restarts=())
    zeros = {n: c.y for n, c in blank.items()}
    mask = {n: np.ones(len(t), bool) for n in noise}
    return Case(coarser(drive) if is_quick else drive, {n: c.t for n, c in blank.items()}, zeros, noise, mask)


def response(hypothesis: Hypothesis, case: Case, run: Map = serial) -> Response:
    """Return the prediction of a hypothesis for a case."""
    problem = replace(hypothesis.problem, cases=(case,))
    predicted = problem.residual(hypothesis.theta)
    slope = jacobian(problem, hypothesis.theta, predicted, run)
    likely = np.array([problem.residual(theta) for theta in hypothesis.likely_values()])
    return Response(problem.residual(hypothesis.if_there()), likely, predicted, slope)


def motion(rig: Rig, command: FloatArray, rate: float) -> dict[str, FloatArray]:
    """Return the noise-free torque and motion of a run from rest, whether or not the bench measures them."""
    case = run_case(command, rate, {n: 1.0 for n in SENSED if rig.measures(n)})
    return simulate_drive(rig, case.drive)  # type: ignore[arg-type]
