"""Time offsets between channels and the command, fitted, their doubt, and lags that drift along a line.

The lag of a channel behind its simulation is followed along a record: a straight line is a clock's rate. In
each block of a second the lag moves by Gauss-Newton steps from that of the block before, with p' = dp/dt,

    lag -> lag - sum p' (y - p) / sum p'^2,   p read `lag` earlier,

so a drift of many radians by the end stays within a fraction of one from block to block. The blocks' lags are
weighted by what they show, sum p'^2.

Whether the data ask for a clock: with c = d r / d clock, the other unknowns projected out of it, and r the
weighted residual without the clock,

    z = c'r / sqrt(max(sum_b s_b^2, c'c)),   s_b = c_b' (r_b - c_b c'r / c'c) of blocks of one second

is a standard normal where the clock is right (score test; blocks as in confidence.py). A clock that the test
does not free counts as right: a free one would compete with damping, because a late F/T sensor looks like
more b_m.

The zero of an even clock through n stamps of scatter s is known to s / sqrt(n). A clock off by d moves a fit
by -H^-1 J' c d, with c = d r / d clock. Channels of one message share a clock; a late command is an
early sensor, all of them together.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rsea_ros.identification.confidence import Confidence, inverse_of, sample_blocks
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.result import Remark
from rsea_ros.identification.solver import Map, Solution, clock_columns, serial, solve
from rsea_ros.identification.unknowns import FASTEST, Unknown, clock_rates, clocks, start_vector
from rsea_ros.model.inverse import is_inverse
from rsea_ros.records.record import FloatArray, IntArray, Record

BLOCK = 1.0
"""s. At 500 ppm the lag changes by half a millisecond in it."""
_FEWEST = 8
"""Blocks: a line through fewer says little."""
_FEWEST_SAMPLES = 8
"""In a block."""
_STEPS, _FARTHEST = 4, 2e-3
"""Steps in a block, and how far all of them together may lead, s for each block since the last."""
_ALIKE = 0.7
"""Of a block's power: what the simulation must explain at its best lag."""
LEAST_RISE = 1e-3
"""s over the record: less turns no phase far, and a linear fit sees it."""
SCATTER = 0.25
"""Of the rise of a line: lags that scatter more about it do not follow a clock."""


_MEDIAN = 0.6745
"""Of a normal's standard deviation: the median of its size."""


class LagLine(NamedTuple):
    """A line through lags: rate (s/s), scatter of the lags about it (s), and its rise over the record (s).

    scatter: by what the blocks show. bend: the rate that the line would have if what half of the blocks are
    off it, each alike, were one bend (s/s).
    """

    rate: float
    scatter: float
    rise: float
    bend: float

    @property
    def is_clear(self) -> bool:
        """Whether the lags follow a clock's line: too far for a linear fit, no faster than clocks run."""
        steep = abs(self.rise) > LEAST_RISE and abs(self.rate) < 1e-6 * FASTEST
        return steep and self.scatter < SCATTER * abs(self.rise)


def lag_line(t: FloatArray, y: FloatArray, p: FloatArray, start: float) -> LagLine | None:
    """Return the line of a channel's lag; None where the blocks do not show one.

    t: s, rising; y, p: measured and simulated, shape (n,), finite. start: of the record, s.
    """
    since, lag, weight = _lags(t, y, p, start)
    if len(lag) < _FEWEST:
        return None
    rate, at_start = np.polyfit(since, lag, 1, w=np.sqrt(weight))
    off, duration = lag - at_start - rate * since, float(np.ptp(t))
    scatter = math.sqrt(float(np.average(off**2, weights=weight)))
    bend = math.sqrt(12.0) * float(np.median(np.abs(off))) / _MEDIAN / duration
    return LagLine(float(rate), scatter, float(rate) * duration, bend)


def _lags(
    t: FloatArray, y: FloatArray, p: FloatArray, start: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return middle (s since start), lag (s) and weight of the blocks that show a lag."""
    slope = np.gradient(p, t)
    lag, last, shown = 0.0, 0, []
    edges = np.searchsorted(t, np.arange(t[0], t[-1] + BLOCK, BLOCK))
    for k, (a, b) in enumerate(pairwise(edges.tolist())):
        if b - a < _FEWEST_SAMPLES:
            continue
        at, share = _lag_of(t[a:b], y[a:b], (t, p, slope), lag, _FARTHEST * (k + 1 - last))
        if share > _ALIKE:
            lag, last = at, k + 1
            shown.append((float(np.mean(t[a:b])) - start, lag, float(np.sum(slope[a:b] ** 2))))
    since, lags, weight = np.ascontiguousarray(np.array(shown).reshape(-1, 3).T)
    return since, lags, weight


def _lag_of(
    t: FloatArray, y: FloatArray, simulated: tuple[FloatArray, FloatArray, FloatArray], lag: float, far: float
) -> tuple[float, float]:
    """Return the lag of one block, and the share of its power that the simulation explains at it."""
    at, p, slope = simulated
    begin = lag
    for _ in range(_STEPS):
        values, slopes = np.interp(t - lag, at, p), np.interp(t - lag, at, slope)
        off = (y - values) - np.mean(y - values)
        size = float(slopes @ slopes)
        if size == 0.0:
            return begin, 0.0
        lag = float(np.clip(lag - float(slopes @ off) / size, begin - far, begin + far))
    residual = y - np.interp(t - lag, at, p)
    return lag, 1.0 - float(np.var(residual)) / max(float(np.var(y)), 1e-300)


ASKED = 3.5
"""Standard deviations from which a clock is asked for: one of six in 360 records where all are right."""
KEPT = 2.0
"""Standard deviations from right, below which a clock that was asked for is taken as right after all."""
MISFIT = 1.3
"""RMS of what clocks leave over the noise, above which something else is wrong and the rate of one stands in
for it."""
WORTH = 2.0
"""Times the interval of a value with the clocks as right, from which what they would cost is said."""


@dataclass(frozen=True)
class RequiredClocks:
    """Clocks that the data require, and by unknown the widening of its interval with the others free."""

    clocks: tuple[Unknown, ...] = ()
    cost: Mapping[str, float] | None = None

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on the precision gained by taking the other clocks as right; empty where it is small."""
        name, times = max((self.cost or {"": 0.0}).items(), key=lambda item: item[1])
        return (Remark("clocks_taken_as_right", (name,), (times,)),) if times >= WORTH else ()


def required_clocks(solution: Solution) -> RequiredClocks:
    """Return the clocks that a fit without any must move, offsets and rates."""
    problem = solution.problem
    if is_inverse(problem.rig):
        return RequiredClocks()
    channels = sorted({n for case in problem.cases for n in problem.present(case)})
    free = {u.name for u in problem.unknowns}
    fixed = [u for u in (*clocks(channels, problem.rig), *clock_rates(channels)) if u.name not in free]
    columns = clock_columns(problem, solution.theta, fixed)
    blocks = sample_blocks(problem, BLOCK)
    chosen: list[int] = []
    for _ in fixed:
        rest = [i for i in range(len(fixed)) if i not in chosen]
        z = [_score(solution, columns, [*chosen, i], fixed, blocks) for i in rest]
        if max(z) < ASKED:
            break
        chosen.append(rest[int(np.argmax(z))])
    if _remainder(solution, columns[:, chosen], [fixed[i] for i in chosen]) > MISFIT:
        chosen = [i for i in chosen if not fixed[i].is_rate]
    others = [i for i, c in enumerate(fixed) if not c.is_rate and i not in chosen]
    return RequiredClocks(
        tuple(fixed[i] for i in chosen), _cost(solution, columns[:, others], [fixed[i] for i in others])
    )


def with_drifts(solution: Solution, run: Map = serial) -> Solution:
    """Return the fit with the rates of clocks free whose lags drift along lines, if they explain its misfit.

    A score is linear: it does not see a clock whose drift turns the phases by a radian. The lags are those
    behind the fit, and behind the rig as stated, which no drift has led astray. Offsets are left to the test.
    """
    problem = solution.problem
    if is_inverse(problem.rig) or solution.rms <= MISFIT:
        return solution
    for theta in (solution.theta, start_vector(problem.unknowns)):
        rates = _drifts(problem, theta)
        added = clock_rates(sorted(rates))
        begin = np.concatenate([theta, [rates[u.name.split(".")[1]] for u in added]])
        free = replace(problem, unknowns=(*problem.unknowns, *added))
        if added and (drifting := solve(free, begin, run=run)).rms <= MISFIT:
            return drifting
    return solution


def _drifts(problem: Problem, theta: FloatArray) -> dict[str, float]:
    """Return the clock's rate of each channel whose lag drifts along a line, ppm, later being positive."""
    rates: dict[str, list[float]] = {}
    for case, out in zip(problem.cases, problem.outputs(theta), strict=True):
        for n in set(problem.present(case)) - {"motor_torque"}:
            keep = case.mask[n]
            line = lag_line(case.t[n][keep], case.measured[n][keep], out[n][keep], case.start)
            if line is not None and line.is_clear:
                rates.setdefault(n, []).append(-1e6 * line.rate)
    return {n: float(np.median(values)) for n, values in rates.items()}


def free_clocks(solution: Solution, required: RequiredClocks) -> tuple[Problem, FloatArray]:
    """Return the problem of a fit with the required clocks among its unknowns, and its start."""
    problem = replace(solution.problem, unknowns=(*solution.problem.unknowns, *required.clocks))
    return problem, np.concatenate([solution.theta, np.zeros(len(required.clocks))])


def without_needless(solution: Solution) -> tuple[Problem, FloatArray]:
    """Return the problem of a fit without clocks that it leaves near enough to right, and where it is."""
    problem, prior = solution.problem, np.diag([u.doubt**-2 for u in solution.problem.unknowns])
    sd = np.sqrt(np.diag(np.linalg.pinv(solution.jacobian.T @ solution.jacobian + prior, hermitian=True)))
    kept = [
        i
        for i, (u, theta) in enumerate(zip(problem.unknowns, solution.theta, strict=True))
        if not u.is_clock or abs(theta) > KEPT * sd[i]
    ]
    return replace(problem, unknowns=tuple(problem.unknowns[i] for i in kept)), solution.theta[kept]


def _score(
    solution: Solution, columns: FloatArray, which: Sequence[int], fixed: Sequence[Unknown], blocks: IntArray
) -> float:
    """Return |z| of the last of some clocks, beside the fit's unknowns and the clocks before it.

    fixed: the clocks that the fit has not freed; which: some of them, by place.
    """
    base = np.column_stack([solution.jacobian, columns[:, list(which[:-1])]])
    known = (*solution.problem.unknowns, *(fixed[i] for i in which[:-1]))
    normal = base.T @ base + np.diag([u.doubt**-2 for u in known])
    column = columns[:, which[-1]]
    column = column - base @ np.linalg.lstsq(normal, base.T @ column, rcond=None)[0]
    clocked = base[:, solution.jacobian.shape[1] :]
    slope = np.concatenate([np.zeros(solution.jacobian.shape[1]), clocked.T @ solution.residual])
    residual = solution.residual - base @ np.linalg.lstsq(normal, slope, rcond=None)[0]
    total, information = float(column @ residual), float(column @ column)
    if information == 0.0:
        return 0.0
    scores = np.bincount(blocks, column * (residual - column * total / information))
    return abs(total) / math.sqrt(max(float(scores @ scores), information))


def _remainder(solution: Solution, columns: FloatArray, chosen: Sequence[Unknown]) -> float:
    """Return the RMS over the noise of the residual with some clocks free, by the derivatives."""
    base = np.column_stack([solution.jacobian, columns])
    known = (*solution.problem.unknowns, *chosen)
    normal = base.T @ base + np.diag([u.doubt**-2 for u in known])
    step = np.linalg.lstsq(normal, base.T @ solution.residual, rcond=None)[0]
    return float(np.sqrt(np.mean((solution.residual - base @ step) ** 2)))


def _cost(solution: Solution, columns: FloatArray, free: Sequence[Unknown]) -> dict[str, float]:
    """Return by unknown how many times as wide its interval would be, were some clocks free beside it.

    Of the unknowns that change the residual by one standard deviation at all within their bounds: the
    interval of another is that of its bounds in any case.
    """
    columns_of = zip(solution.jacobian.T, solution.problem.unknowns, strict=True)
    shown = [i for i, (column, u) in enumerate(columns_of) if np.linalg.norm(column) * u.reach >= 1.0]
    jacobian, unknowns = solution.jacobian[:, shown], [solution.problem.unknowns[i] for i in shown]
    without, beside = (
        np.diag(np.linalg.pinv(base.T @ base + np.diag([u.doubt**-2 for u in known]), hermitian=True))
        for base, known in ((jacobian, unknowns), (np.column_stack([jacobian, columns]), (*unknowns, *free)))
    )
    wider = np.sqrt(beside[: len(unknowns)] / np.maximum(without, 1e-300))
    return {u.name: float(w) for u, w in zip(unknowns, wider, strict=True)}


def with_even_clocks(
    confidence: Confidence, solution: Solution, stamped: Sequence[Record], even: Sequence[Record]
) -> Confidence:
    """Return the confidence of a fit to records on even clocks, their doubt included.

    stamped: the same records with the stamps that they came with.
    """
    moved = list(_clock_sensitivities(solution, stamped, even))
    if not moved:
        return confidence
    prior = np.diag([u.reach**-2 for u in solution.problem.unknowns])
    steps = inverse_of(confidence.information + prior) @ solution.jacobian.T @ np.column_stack(moved)
    return replace(confidence, covariance=confidence.covariance + steps @ steps.T)


def _clock_sensitivities(
    solution: Solution, stamped: Sequence[Record], even: Sequence[Record]
) -> Iterator[FloatArray]:
    """Yield the change of the residual by one sigma of each even clock, shape (m,)."""
    problem = solution.problem
    doubts = [_doubts(before, after) for before, after in zip(stamped, even, strict=True)]
    if not any(doubts):
        return
    columns = _columns(solution)
    numbers = {id(case): float(k) for k, case in enumerate(problem.cases)}
    of = problem.by_row(lambda case, n: numbers[id(case)])
    for k, groups in enumerate(doubts):
        for names, doubt in groups:
            chosen = columns if "command" in names else columns.keys() & set(names)
            yield np.where(of == k, doubt * sum(columns[n] for n in chosen), 0.0)


def _columns(solution: Solution) -> dict[str, FloatArray]:
    """Return d residual / d clock by channel, shape (m,)."""
    problem = solution.problem
    measured = [n for n in problem.channels if any(n in case.measured for case in problem.cases)]
    timed = [n for n in measured if n != "motor_torque"]
    return dict(zip(timed, clock_columns(problem, solution.theta, clocks(timed, problem.rig)).T, strict=True))


def _doubts(stamped: Record, even: Record) -> list[tuple[tuple[str, ...], float]]:
    """Return the channels that share an even clock, and one sigma of its zero, s."""
    groups: dict[bytes, list[str]] = {}
    for n in stamped.channels.keys() & even.channels.keys():
        if not np.array_equal(stamped[n].t, even[n].t):
            groups.setdefault(stamped[n].t.tobytes(), []).append(n)
    return [(tuple(names), _doubt(stamped[names[0]].t, even[names[0]].t)) for names in groups.values()]


def _doubt(t: FloatArray, even: FloatArray) -> float:
    late = t - even  # on the mean only where stamps of arrival have an edge: it may be as late itself
    return float(np.hypot(np.std(late) / np.sqrt(len(t)), np.mean(late)))
