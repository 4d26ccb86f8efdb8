"""The design of a run that tells hypotheses apart, and its refinement.

Shapes of every kind are tried, from the shortest run to the length that no chance of deciding could make
worth its seconds; the best is refined by Nelder and Mead's method (scipy), which needs no smooth
objective: gear friction and stops give none. Where full fits of the rivals leave it nothing to decide, the
longest run is designed instead. separation.py rates shapes by simulation and has the measure. The final
amplitude is the largest with which proposal.py keeps all limits.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import minimize

from rsea_ros.errors import ParameterError
from rsea_ros.experiment import separation
from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.proposal import DesignRequest, Group, Peaks, Proposal, ends_of, peaks
from rsea_ros.experiment.run_shape import Shape, largest_share
from rsea_ros.identification.solver import Map, serial
from rsea_ros.progress import Progress
from rsea_ros.records.record import BoolArray, FloatArray


def refine(
    start: Shape, value: Callable[[Shape], float], asked: DesignRequest, say: Progress
) -> tuple[Shape, int]:
    """Return the shape near `start` of the largest value, and how many were rated."""
    names = {
        "multisine": ("bias", "amplitude", "low", "high", "tilt"),
        "chirp": ("bias", "amplitude", "low", "high"),
        "steps": ("bias", "amplitude", "hold"),
        "holds": ("bias", "amplitude", "hold"),
    }[start.kind]
    values = {n: getattr(start, n) for n in names}
    first = np.array([math.log(v) if n in _LOGARITHMIC else v for n, v in values.items()])
    seen: list[tuple[float, Shape]] = []

    def loss(x: FloatArray) -> float:
        moved: dict[str, Any] = {n: _outer(n, float(v), asked) for n, v in zip(names, x, strict=True)}
        shape = replace(start, **moved)
        shape = replace(shape, high=max(shape.high, 1.5 * shape.low))
        seen.append((value(shape), shape))
        say("refining", 0.6 + 0.35 * min(1.0, len(seen) / max(asked.refine, 1)))
        return -seen[-1][0]

    if asked.refine:
        simplex = np.vstack([first, *(first + 0.25 * np.eye(len(first)))])
        options = {"maxfev": asked.refine, "initial_simplex": simplex, "xatol": 0.02, "fatol": 2e-3}
        minimize(loss, first, method="Nelder-Mead", options=options)
    return (max(seen, key=lambda item: item[0])[1] if seen else start), len(seen)


_LOGARITHMIC = ("low", "high", "hold")


def _outer(name: str, x: float, asked: DesignRequest) -> float:
    """Return the value of a shape's number within its sensible range."""
    value = math.exp(min(x, 50.0)) if name in _LOGARITHMIC else x
    low, high = {
        "bias": (-0.8, 0.8),
        "amplitude": (0.1, 1.0),
        "low": (0.05, 0.2 * asked.rate),
        "high": (1.0, 0.475 * asked.rate),
        "tilt": (-0.5, 1.5),
        "hold": (0.02, 2.0),
    }[name]
    return min(max(value, low), high)


_HOPE = 2.0
"""S that the longest run's data give a pair at best, below which no run is designed for it."""
_FAR = 1e4
"""S of one linear step, above which a full fit of the rival would not bring it near nothing."""
_SETTLED = 5e-3
"""Share of undecided cases below which no run is worth playing."""
_SMALLEST, _BISECTIONS = 0.01, 8


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
    rig = hypotheses[0].problem.rig
    if rig.loop is not None:
        raise ParameterError(
            f"rig {rig.name}: positions command it, expected a rig that torques command: "
            "limits of the torque do not bound a position loop"
        )
    noise = separation.noise_by_channel(hypotheses, measured or {})
    rater = separation.ShapeRater(hypotheses, asked, noise, run)
    if len(hypotheses) == 1:
        return _sharpest(rater, say)
    shapes = separation.shapes_for(asked)
    tables = []
    for k, shape in enumerate(shapes):
        say(f"trying {shape.kind}", 0.5 * k / len(shapes))
        tables.append(separation.separations(hypotheses, rater.responses(rater.within(shape, asked.probe))))
    say("fitting rivals", 0.5)
    apart = _hopeless(rater, shapes, tables)
    trials = separation.try_lengths(rater, shapes, apart, asked.shortest)
    best = separation.best_of(trials, asked)
    say("refining", 0.6)
    shape, count = refine(
        best.shape, lambda s: separation.trial_of(rater, s, best.length, apart).share, asked, say
    )
    tried = len(shapes) + len(trials) + count
    final = _final(rater, shape, best.length, apart, tried)
    if final.decided >= separation.least_share(asked) or best.length == asked.longest:
        return final
    trial = separation.best_of(separation.try_lengths(rater, shapes, apart, asked.longest), asked)
    longest = _final(rater, trial.shape, trial.length, apart, tried + len(shapes))
    return max(longest, final, key=lambda p: p.decided)


def _resolved(
    rater: separation.ShapeRater, chances: FloatArray, rows: Sequence[FloatArray], apart: BoolArray
) -> float:
    """Return the share that a run decides of the cases that are undecided without it; 1 for a single cause.

    Without it: what is likely enough already, and what only a hopeless pair leaves open.
    """
    if len(chances) == 1:
        return 1.0
    nothing = [np.where(np.isfinite(r), 0.0, r) for r in rows]
    already = separation.share_decided(rater, separation.chances_decided(rater.hypotheses, nothing, apart))
    open_, gained = 1.0 - already, separation.share_decided(rater, chances) - already
    return max(gained, 0.0) / open_ if open_ > _SETTLED else 0.0


def _hopeless(
    rater: separation.ShapeRater, shapes: Sequence[Shape], tables: Sequence[FloatArray]
) -> BoolArray:
    """Return which pairs no tried shape separates in the longest run, in either direction, shape (k, k)."""
    stack = np.array(tables)
    apart = np.eye(stack.shape[1], dtype=bool)
    for a, b in combinations(range(len(apart)), 2):
        both = [(float(stack[k, i, j]), k, i, j) for k in range(len(shapes)) for i, j in ((a, b), (b, a))]
        ranked = sorted(both, reverse=True)
        apart[a, b] = apart[b, a] = not any(_may_show(rater, shapes[k], s, i, j) for s, k, i, j in ranked)
    return apart


def _may_show(rater: separation.ShapeRater, shape: Shape, linear: float, i: int, j: int) -> bool:
    """Return whether the longest run of a shape may separate a rival j from i. linear: S of a probe of it.

    A linear step can also leave too much: a rival that contains the other is fitted in full.
    """
    asked = rater.asked
    longer = asked.longest / asked.probe
    if linear >= _FAR or linear * longer < _HOPE:
        return linear >= _FAR
    case = rater.case(rater.within(shape, asked.probe), is_quick=True)
    return separation.refit(rater.hypotheses[i], rater.hypotheses[j], case, rater.run).data * longer >= _HOPE


def _final(
    rater: separation.ShapeRater, shape: Shape, length: float, apart: BoolArray, tried: int
) -> Proposal:
    """Return the proposal of a shape, as large as the limits allow under doubt, judged with full steps."""
    asked, hypotheses = rater.asked, rater.hypotheses
    largest = rater.within(shape, length) / separation.INSIDE
    command, reached = limit_command(largest, asked, ends_of(hypotheses))
    responses = rater.responses(command, is_quick=False)
    linear = separation.separations(hypotheses, responses)
    table = _with_refits(rater, command, linear)
    names = tuple(h.name for h in hypotheses)
    pairs = tuple((names[i], names[j]) for i, j in combinations(range(len(names)), 2) if apart[i, j])
    narrow = separation.information_gain(hypotheses[0], responses[0])
    energy = float(np.sum(command**2) / asked.rate)
    nearer = np.divide(table, linear, out=np.ones_like(table), where=np.isfinite(table) & (linear > 0.0))
    rows = separation.likely_separations(hypotheses, responses)
    nearest = [r * n for r, n in zip(rows, nearer, strict=True)]
    chances = separation.chances_decided(hypotheses, nearest, apart)
    share = separation.share_decided(rater, chances) if len(names) > 1 else 1.0
    return Proposal(
        shape, length, asked.rate, command, names, table, pairs, share, tuple(chances.tolist()),
        _resolved(rater, chances, rows, apart), narrow, reached, tried, energy,
    )  # fmt: skip


def limit_command(
    command: FloatArray, asked: DesignRequest, groups: Sequence[Group]
) -> tuple[FloatArray, Peaks]:
    """Return a command as large as the limits allow for every possible bench, and its peaks.

    By bisection, because the worst response is not linear in the command. Raises
    ParameterError where even the share _SMALLEST of it breaks the limits.
    """
    low, high, scale, best = math.log(_SMALLEST), 0.0, 0.0, None
    for _ in range(_BISECTIONS):
        reached = peaks(math.exp(scale) * command, asked.rate, groups)
        if largest_share(reached.at_level, asked.limits) <= 1.0:
            low, best = scale, (math.exp(scale) * command, reached)
        else:
            high = scale
        if best is not None and high - low < 0.05:
            break
        scale = 0.5 * (low + high)
    if best is None:
        limits = asked.limits.finite_limits().items()
        still = ", ".join(f"{n} {reached.at_level[n]:.4g} of {v:g}" for n, v in limits)
        raise ParameterError(
            "no run keeps the limits for all that the bench may be, expected wider limits: at a share of "
            f"{_SMALLEST:g} still {still}"
        )
    return best


def _with_refits(rater: separation.ShapeRater, command: FloatArray, table: FloatArray) -> FloatArray:
    """Return S with a full fit of each nearest rival, where one linear step does not settle it."""
    case, table = rater.case(command, is_quick=False), table.copy()
    for i, row in enumerate(table):
        j = int(np.argmin(row))
        if row[j] < _FAR:
            table[i, j] = separation.refit(rater.hypotheses[i], rater.hypotheses[j], case, rater.run).total
    return table


def _sharpest(rater: separation.ShapeRater, say: Progress) -> Proposal:
    """Return the run that narrows the parameters of a single cause most (D-optimality)."""
    asked = rater.asked
    shapes = separation.shapes_for(asked)

    def value(shape: Shape) -> float:
        command = rater.within(shape, asked.probe)
        return separation.information_gain(rater.hypotheses[0], rater.responses(command)[0])

    values = [value(shape) for shape in shapes]
    shape, count = refine(shapes[int(np.argmax(values))], value, asked, say)
    return _final(rater, shape, asked.longest, np.eye(1, dtype=bool), len(shapes) + count)
