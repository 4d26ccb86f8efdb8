"""Design of a run: the shape and length that decide most per second, within limits for every possible bench.

Shapes of every kind are tried, the best is refined by Nelder and Mead's method (scipy), which needs no smooth
objective: gear friction and stops give none. Shapes are rated by simulation with the compiled step;
separation.py has the measure. The final amplitude is the largest with which chance_constraint.py keeps all
limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.experiment.chance_constraint import Group, Peaks, ends_of, peaks, share_used
from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.proposal import DesignRequest, Proposal
from rsea_ros.experiment.refine import refine
from rsea_ros.experiment.run_shape import Shape
from rsea_ros.experiment.separation import decided_share, information_gain, refit, separations
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
    Shape("steps", 1.0, hold=0.1),
    Shape("steps", 1.0, hold=0.3),
    Shape("holds", 1.0, hold=0.15),
    Shape("steps", 0.3, bias=0.5, hold=0.2),
)
"""Where the search begins; amplitude and bias as shares of what the limits allow."""
_PER_RUN = 0.5
"""s that a run costs beside its excitation, in what it must decide."""
_HOPE = 2.0
"""S that the longest run's data give a pair at best, below which no run is designed for it."""
_FAR = 1e4
"""S of one linear step, above which a full fit of the rival would not bring it near nothing."""
_KEPT = 0.8
"""Of what the probe promises of a shorter run, what that must keep; else it is made longer."""
_SMALLEST, _BISECTIONS = 0.01, 8


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
        say(f"trying {shape.kind}", 0.6 * k / len(shapes))
        tables.append(separations(hypotheses, rater.responses(rater.within(shape, asked.probe))))
    say("fitting rivals", 0.6)
    apart = _hopeless(rater, shapes, tables)
    values = [max(_per_second(rater, t, apart, asked))[0] for t in tables]
    length = max(_per_second(rater, tables[int(np.argmax(values))], apart, asked))[1]

    def value(shape: Shape) -> float:
        table = separations(hypotheses, rater.responses(rater.within(shape, length)))
        return decided_share(table, rater.probability, apart)

    again = [value(shape) for shape in shapes]
    while max(again) < _KEPT * max(values) * (_PER_RUN + length) and 2.0 * length <= asked.longest:
        length *= 2.0
        again = [value(shape) for shape in shapes]
    shape, count = refine(shapes[int(np.argmax(again))], value, asked, say)
    return _final(rater, shape, length, apart, 2 * len(shapes) + count)


def _hopeless(rater: ShapeRater, shapes: Sequence[Shape], tables: Sequence[FloatArray]) -> BoolArray:
    """Return which pairs no tried shape separates in the longest run, in either direction, shape (k, k)."""
    stack, asked = np.array(tables), rater.asked
    apart = np.eye(len(rater.hypotheses), dtype=bool)
    for a, b in combinations(range(len(apart)), 2):
        i, j = (a, b) if stack[:, a, b].max() > stack[:, b, a].max() else (b, a)
        best = int(np.argmax(stack[:, i, j]))
        if stack[best, i, j] < _FAR:
            case = rater.case(rater.within(shapes[best], asked.probe), is_quick=True)
            data = refit(rater.hypotheses[i], rater.hypotheses[j], case, rater.run).data
            apart[i, j] = apart[j, i] = data * asked.longest / asked.probe < _HOPE
    return apart


def _per_second(
    rater: ShapeRater, table: FloatArray, apart: BoolArray, asked: DesignRequest
) -> list[tuple[float, float]]:
    """Return the share of cases that a shape decides per second, and the length, for several run lengths."""
    lengths = np.geomspace(asked.shortest, asked.longest, 7)
    scaled = [(decided_share(table * s / asked.probe, rater.probability, apart), float(s)) for s in lengths]
    return [(share / (_PER_RUN + s), s) for share, s in scaled]


def _final(rater: ShapeRater, shape: Shape, length: float, apart: BoolArray, tried: int) -> Proposal:
    """Return the proposal of a shape, as large as the limits allow under doubt, judged with full steps."""
    asked, hypotheses = rater.asked, rater.hypotheses
    command, reached = limit_command(rater.within(shape, length) / INSIDE, asked, ends_of(hypotheses))
    responses = rater.responses(command, is_quick=False)
    table = _with_refits(rater, command, separations(hypotheses, responses))
    names = tuple(h.name for h in hypotheses)
    k = len(names)
    pairs = tuple((names[i], names[j]) for i in range(k) for j in range(i + 1, k) if apart[i, j])
    narrow = information_gain(hypotheses[0], responses[0])
    energy = float(np.sum(command**2) / asked.rate)
    share = decided_share(table, rater.probability, apart) if k > 1 else 1.0
    return Proposal(
        shape, length, asked.rate, command, names, table, pairs, share, narrow, reached, tried,
        energy,
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
