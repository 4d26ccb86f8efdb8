"""Design of a run: the shape and length that decide most per second, within limits for every possible bench.

Shapes of every kind are tried, from the shortest run to the length that no chance of deciding could make
worth its seconds; the best is refined by Nelder and Mead's method (scipy), which needs no smooth
objective: gear friction and stops give none. Where full fits of the rivals leave it nothing to decide, the
longest run is designed instead. Shapes are rated by simulation with the compiled step;
separation.py has the measure. The final amplitude is the largest with which chance_constraint.py keeps all
limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.experiment.chance_constraint import Group, Peaks, ends_of, peaks, share_used
from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.proposal import DesignRequest, Proposal
from rsea_ros.experiment.refine import refine
from rsea_ros.experiment.run_shape import FEWEST, Shape
from rsea_ros.experiment.separation import (
    chances_decided,
    decided_share,
    information_gain,
    likely_separations,
    refit,
    separations,
)
from rsea_ros.experiment.shape_rater import INSIDE, ShapeRater, noise_by_channel
from rsea_ros.identification.solver import Map, serial
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.signals import BoolArray, FloatArray

TRIED: tuple[Shape, ...] = (
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
_HOPE = 2.0
"""S that the longest run's data give a pair at best, below which no run is designed for it."""
_FAR = 1e4
"""S of one linear step, above which a full fit of the rival would not bring it near nothing."""
_SETTLED = 5e-3
"""Share of undecided cases below which no run is worth playing."""
_SMALLEST, _BISECTIONS = 0.01, 8
_FURTHEST = 6
"""Doublings of the torque limit up to which a torque that would show a cause is sought."""


def check_commanded_by_torque(rig: Rig) -> None:
    """Raise ParameterError for a rig that no torque commands."""
    if rig.loop is not None:
        raise ParameterError(
            f"rig {rig.name}: positions command it, expected a rig that torques command: "
            "limits of the torque do not bound a position loop"
        )


def propose(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float] | None = None,
    run: Map = serial,
    tell: Progress | None = None,
) -> Proposal:
    """Return the run that separates hypotheses best, or where one is left narrows its parameters most.

    measured: noise by channel as records show it. Raises ParameterError where the rig has no torque command.
    """
    say = tell or (lambda step, share: None)
    check_commanded_by_torque(hypotheses[0].problem.rig)
    rater = ShapeRater(hypotheses, asked, noise_by_channel(hypotheses, measured or {}), run)
    if len(hypotheses) == 1:
        return _sharpest(rater, say)
    shapes = [s for s in TRIED if s.kind in asked.kinds]
    tables = []
    for k, shape in enumerate(shapes):
        say(f"trying {shape.kind}", 0.5 * k / len(shapes))
        tables.append(separations(hypotheses, rater.responses(rater.within(shape, asked.probe))))
    say("fitting rivals", 0.5)
    apart = _hopeless(rater, shapes, tables)
    trials = _trials(rater, shapes, apart, asked.shortest)
    best = _worth_most(trials, asked)
    say("refining", 0.6)
    shape, count = refine(best.shape, lambda s: _share(rater, s, best.length, apart), asked, say)
    tried = len(shapes) + len(trials) + count
    final = _final(rater, shape, best.length, apart, tried)
    if final.decided >= _least(asked) or best.length == asked.longest:
        return final
    trial = _worth_most(_trials(rater, shapes, apart, asked.longest), asked)
    longest = _final(rater, trial.shape, trial.length, apart, tried + len(shapes))
    return max(longest, final, key=lambda p: p.decided)


def torque_that_shows(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float],
    run: Map = serial,
) -> float | None:
    """Return about what torque limit a test needs that shows the other causes, N m; None beyond _FURTHEST.

    In the longest run, the other limits as they are, none of which may hold the torque back.
    """
    for k in range(1, _FURTHEST + 1):
        torque = 2.0**k * asked.limits.torque
        wider = replace(asked, limits=replace(asked.limits, torque=torque))
        rater = ShapeRater(hypotheses, wider, noise_by_channel(hypotheses, measured), run)
        shapes = [s for s in TRIED if s.kind in asked.kinds]
        apart = np.eye(len(hypotheses), dtype=bool)
        if max(_share(rater, s, asked.longest, apart) for s in shapes) >= asked.test:
            return torque
    return None


def _least(asked: DesignRequest) -> float:
    """Return the share that a run must be expected to decide to be preferred to a longer one."""
    return asked.test or _LEAST


@dataclass(frozen=True)
class _Trial:
    """A shape of a length (s), the share that it is expected to decide, the least S of the likeliest two."""

    share: float
    length: float
    shape: Shape
    least: float

    def per_second(self, per_run: float) -> float:
        return self.share / (per_run + self.length)


def _trials(rater: ShapeRater, shapes: Sequence[Shape], apart: BoolArray, shortest: float) -> list[_Trial]:
    """Return the shapes of every length from some seconds, up to one that could not be worth its seconds."""
    asked, trials = rater.asked, list[_Trial]()
    doublings = math.ceil(math.log2(asked.longest / shortest))
    for seconds in np.geomspace(shortest, asked.longest, doublings + 1):
        length = float(np.rint(seconds * asked.rate) / asked.rate)
        best = _worth_most(trials, asked) if trials else None
        if (
            best
            and best.share >= _least(asked)
            and best.per_second(asked.per_run) > 1.0 / (asked.per_run + length)
        ):
            break
        possible = [s for s in shapes if length * asked.rate >= FEWEST[s.kind]]
        trials += [_trial(rater, s, length, apart) for s in possible]
    return trials


def _worth_most(trials: Sequence[_Trial], asked: DesignRequest) -> _Trial:
    """Return the trial that decides most per second; where none decides enough, the one that decides most.

    Of several that decide nothing the longest, with the largest S of the likeliest two.
    """
    enough = [t for t in trials if t.share >= _least(asked)]
    if not enough:
        return max(trials, key=lambda t: (t.share, t.length, t.least))
    return max(enough, key=lambda t: t.per_second(asked.per_run))


def _share(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray) -> float:
    return _trial(rater, shape, length, apart).share


def _trial(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray) -> _Trial:
    rows = likely_separations(rater.hypotheses, rater.responses(rater.within(shape, length)))
    share = _decided(rater, chances_decided(rater.hypotheses, rows, apart))
    first, second = sorted(range(len(rows)), key=lambda k: -rater.hypotheses[k].probability)[:2]
    least = min(float(rows[first][:, second].mean()), float(rows[second][:, first].mean()))
    return _Trial(share, length, shape, least)


def _decided(rater: ShapeRater, chances: FloatArray) -> float:
    """Return the share of the cases that a run is expected to decide; in a test, of those it is for."""
    first = 1 if rater.asked.test else 0
    return decided_share(rater.hypotheses[first:], chances[first:])


def _resolved(
    rater: ShapeRater, chances: FloatArray, rows: Sequence[FloatArray], apart: BoolArray
) -> float:
    """Return the share that a run decides of the cases that are undecided without it; 1 for a single cause.

    Without it: what is likely enough already, and what only a hopeless pair leaves open.
    """
    if len(chances) == 1:
        return 1.0
    nothing = [np.where(np.isfinite(r), 0.0, r) for r in rows]
    already = _decided(rater, chances_decided(rater.hypotheses, nothing, apart))
    open_, gained = 1.0 - already, _decided(rater, chances) - already
    return max(gained, 0.0) / open_ if open_ > _SETTLED else 0.0


def _hopeless(rater: ShapeRater, shapes: Sequence[Shape], tables: Sequence[FloatArray]) -> BoolArray:
    """Return which pairs no tried shape separates in the longest run, in either direction, shape (k, k)."""
    stack = np.array(tables)
    apart = np.eye(stack.shape[1], dtype=bool)
    for a, b in combinations(range(len(apart)), 2):
        both = [(float(stack[k, i, j]), k, i, j) for k in range(len(shapes)) for i, j in ((a, b), (b, a))]
        ranked = sorted(both, reverse=True)
        apart[a, b] = apart[b, a] = not any(_may_show(rater, shapes[k], s, i, j) for s, k, i, j in ranked)
    return apart


def _may_show(rater: ShapeRater, shape: Shape, linear: float, i: int, j: int) -> bool:
    """Return whether the longest run of a shape may separate a rival j from i. linear: S of a probe of it.

    A linear step can also leave too much: a rival that contains the other is fitted in full.
    """
    asked = rater.asked
    longer = asked.longest / asked.probe
    if linear >= _FAR or linear * longer < _HOPE:
        return linear >= _FAR
    case = rater.case(rater.within(shape, asked.probe), is_quick=True)
    return refit(rater.hypotheses[i], rater.hypotheses[j], case, rater.run).data * longer >= _HOPE


def _final(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray, tried: int) -> Proposal:
    """Return the proposal of a shape, as large as the limits allow under doubt, judged with full steps."""
    asked, hypotheses = rater.asked, rater.hypotheses
    command, reached = limit_command(rater.within(shape, length) / INSIDE, asked, ends_of(hypotheses))
    responses = rater.responses(command, is_quick=False)
    linear = separations(hypotheses, responses)
    table = _with_refits(rater, command, linear)
    names = tuple(h.name for h in hypotheses)
    k = len(names)
    pairs = tuple((names[i], names[j]) for i in range(k) for j in range(i + 1, k) if apart[i, j])
    narrow = information_gain(hypotheses[0], responses[0])
    energy = float(np.sum(command**2) / asked.rate)
    nearer = np.divide(table, linear, out=np.ones_like(table), where=np.isfinite(table) & (linear > 0.0))
    rows = likely_separations(hypotheses, responses)
    chances = chances_decided(hypotheses, [r * n for r, n in zip(rows, nearer, strict=True)], apart)
    share = _decided(rater, chances) if k > 1 else 1.0
    return Proposal(
        shape, length, asked.rate, command, names, table, pairs, share, tuple(chances.tolist()),
        _resolved(rater, chances, rows, apart), narrow,
        reached, tried, energy,
    )  # fmt: skip


def limit_command(
    command: FloatArray, asked: DesignRequest, groups: Sequence[Group]
) -> tuple[FloatArray, Peaks]:
    """Return a command as large as the limits allow for every possible bench, and its peaks.

    By bisection, because the worst response is not linear in the command. Raises
    ParameterError where even a SMALLEST share of it breaks the limits.
    """
    low, high, best = math.log(_SMALLEST), 0.0, None
    scale = high
    for _ in range(_BISECTIONS):
        reached = peaks(math.exp(scale) * command, asked.rate, groups)
        if share_used(reached, asked.limits) <= 1.0:
            low, best = scale, (math.exp(scale) * command, reached)
        else:
            high = scale
        if best is not None and high - low < 0.05:
            break
        scale = 0.5 * (low + high)
    if best is None:
        raise ParameterError(
            "no run keeps the limits for all that the bench may be, expected wider limits: at a share of "
            f"{_SMALLEST:g} still "
            + ", ".join(
                f"{n} {reached.at_level[n]:.4g} of {v:g}" for n, v in asked.limits.finite_limits().items()
            )
        )
    return best


def _with_refits(rater: ShapeRater, command: FloatArray, table: FloatArray) -> FloatArray:
    """Return S with a full fit of each nearest rival, where one linear step does not settle it."""
    case, table = rater.case(command, is_quick=False), table.copy()
    for i, row in enumerate(table):
        j = int(np.argmin(row))
        if row[j] < _FAR:
            table[i, j] = refit(rater.hypotheses[i], rater.hypotheses[j], case, rater.run).total
    return table


def _sharpest(rater: ShapeRater, say: Progress) -> Proposal:
    """Return the run that narrows the parameters of a single cause most (D-optimality)."""
    asked = rater.asked
    shapes = [s for s in TRIED if s.kind in asked.kinds]

    def value(shape: Shape) -> float:
        command = rater.within(shape, asked.probe)
        return information_gain(rater.hypotheses[0], rater.responses(command)[0])

    values = [value(shape) for shape in shapes]
    shape, count = refine(shapes[int(np.argmax(values))], value, asked, say)
    return _final(rater, shape, asked.longest, np.eye(1, dtype=bool), len(shapes) + count)
