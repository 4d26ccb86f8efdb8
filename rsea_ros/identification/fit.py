"""The fit: parameters and noise in turn, until neither changes; on even clocks, and with a law added.

Scattered stamps read the simulation at wrong instants, and those of commands drive it at wrong instants. That
is more than noise: quick motion seems to need more torque, and a fit finds too much damping (errors in
variables; Fuller, Measurement Error Models, 1987). The values decide whether the stamps or the even clock
behind them are
right: the simulation agrees with one of them.

Where the model does not fit, the missing law biases its estimates, and no covariance of the
residual shows that: a motor constant 10 % off moves K_s by 11 % while K_s seems known to 0.01 %. So each of a
few laws that a bench often has is added in turn and fitted with everything else. One that takes away part of
the misfit is credible, and its estimates widen the intervals (model averaging, Buckland et al. 1997, in its
most careful form: the span). Only the diagnosis decides which law it is.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.parameter import Scale
from rsea_ros.errors import RseaError
from rsea_ros.identification import clocks as timing
from rsea_ros.identification.confidence import Confidence, confidence_of, interval
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import Case, Problem, case_from, weighted_residual, with_noise_along
from rsea_ros.identification.result import Remark
from rsea_ros.identification.solver import Map, Pools, Solution, serial, solve
from rsea_ros.identification.start import scale_of, settled_starts
from rsea_ros.identification.unknowns import (
    Unknown,
    apply,
    clocks,
    idle,
    start_vector,
    unknowns_of_effect,
    unknowns_of_rig,
    vector_of,
    with_effect,
)
from rsea_ros.model.inverse import as_seen, is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import MEASURED, BoolArray, Channel, FloatArray, Record


def as_recorded(rig: Rig, records: Sequence[Record]) -> tuple[Rig, tuple[Remark, ...]]:
    """Return a rig with no spring that no record could show, and the remark that says so."""
    seen, numbers = as_seen(rig, records)
    return seen, (Remark("unseen_spring", values=numbers),) if numbers else ()


def misfit_ratios(solution: Solution) -> dict[str, float]:
    """Return by channel the RMS of a solution's residual over its noise: 1 where it is at the noise."""
    problem = solution.problem
    return ratios_of(problem, problem.cases, problem.outputs(solution.theta))


def ratios_of(
    problem: Problem, cases: Sequence[Case], outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, float]:
    """Return by channel the RMS of the residual over its noise: 1 where it is at the noise."""
    parts: dict[str, list[FloatArray]] = {}
    for case, out in zip(cases, outputs, strict=True):
        for n in problem.present(case):
            parts.setdefault(n, []).append(weighted_residual(case, out, [n]))
    return {n: float(np.sqrt(np.mean(np.concatenate(p) ** 2))) for n, p in parts.items()}


def reweight(case: Case, ratios: Mapping[str, float]) -> Case:
    """Return a case in which the residual of a channel counts as its noise, where it is larger."""
    return replace(case, noise={n: s * max(1.0, ratios.get(n, 1.0)) for n, s in case.noise.items()})


_REWEIGHTINGS = 3
_OTHER_NOISE = 1.1
"""Ratio of a channel's noise after a fit to that before, from which the fit is repeated."""


def fit(
    cases: Sequence[Case], rig: Rig, run: Map = serial, start: Rig | None = None
) -> tuple[Solution, tuple[Case, ...], timing.RequiredClocks]:
    """Fit the rig's free values, its effects and the clocks that the data require.

    Returns also the cases with their noise, and the result of the clock tests.

    The noise is the one that the first fit's residual shows. Where a channel's residual stays above it the
    weight becomes that residual, as in maximum likelihood with unknown noise. start: a start,
    if the records fit it better than `rig`. The forms of a law are free once the rest fits.
    """
    unknowns = tuple(u for u in unknowns_of(rig, cases) if not u.is_clock)
    problem = Problem(tuple(cases), rig, unknowns, MEASURED)
    laws = [effect_named(e.name) for e in rig.effects]
    if forms := {f"{law.name}.{p.name}" for law in laws for p in law.parameters if p.optional}:
        rest = replace(problem, unknowns=tuple(u for u in unknowns if u.name not in forms))
        first = solve(rest, _better_start(rest, start, run), run=run)
        start = apply(rig, rest.unknowns, first.theta)[0]
    begin = _better_start(problem, start, run)
    solution = solve(*settled_starts(problem, begin, run), run=run)
    outputs, known = _with_noise(solution)
    changes = [b.noise[n] / a.noise[n] for a, b in zip(cases, known, strict=True) for n in a.noise]
    if not all(1.0 / _OTHER_NOISE < change < _OTHER_NOISE for change in changes):
        solution = solve(replace(solution.problem, cases=known), solution.theta, run=run)
        outputs, known = _with_noise(solution)
    drifting = timing.with_drifts(solution, run)
    if drifting is not solution:
        solution = drifting
        outputs, known = _with_noise(solution)
    required = timing.required_clocks(solution)
    if required.clocks:
        solution = solve(*timing.free_clocks(solution, required), run=run)
        solution = solve(*timing.without_needless(solution), run=run)
        outputs, known = _with_noise(solution)
    problem = solution.problem
    for _ in range(_REWEIGHTINGS):
        ratios = ratios_of(problem, solution.problem.cases, outputs)
        if max(ratios.values()) < timing.MISFIT:
            break
        cases = tuple(reweight(c, ratios) for c in solution.problem.cases)
        solution = solve(replace(problem, cases=cases), solution.theta, run=run)
        outputs = problem.outputs(solution.theta)
    return solution, known, required


def _with_noise(solution: Solution) -> tuple[list[dict[str, FloatArray]], tuple[Case, ...]]:
    """Return the outputs of a solution, and its cases with the noise that its residual shows."""
    outputs = solution.problem.outputs(solution.theta)
    return outputs, with_noise_of(solution.problem.cases, solution, outputs)


def with_noise_of(
    cases: Sequence[Case], solution: Solution, outputs: Sequence[dict[str, FloatArray]]
) -> tuple[Case, ...]:
    """Return cases with the noise that the residual of a solution's outputs shows."""
    problem = solution.problem
    rig = apply(problem.rig, problem.unknowns, solution.theta)[0]
    runs = ((with_noise_along(rig, c), out) for c, out in zip(cases, outputs, strict=True))
    return tuple(reestimate_noise(c, out, rig["gear.ratio"]) for c, out in runs)


def _better_start(problem: Problem, start: Rig | None, run: Map) -> FloatArray:
    """Return the coordinates of `start` where the residual is smaller there than at the rig's own values."""
    stated = start_vector(problem.unknowns)
    if start is None:
        return stated
    other = vector_of(problem.unknowns, start)
    costs = [float(r @ r) for r in run(lambda k: problem.residual((stated, other)[k]), (0, 1))]
    return other if costs[1] < costs[0] else stated


def unknowns_of(rig: Rig, cases: Sequence[Case]) -> tuple[Unknown, ...]:
    """Return all that a fit of these cases may move."""
    channels = sorted({n for case in cases for n in case.measured})
    scale = scale_of(cases, rig) if rig.effects else Scale()
    stated = [(effect_named(e.name).at(scale).widen(e.parameters), e.parameters) for e in rig.effects]
    effects = [unknowns_of_effect(e, start, rig.known | idle(e, rig)) for e, start in stated]
    own = [differs.values if (differs := rig.condition(case.source)) else {} for case in cases]
    records = {"", *(PurePath(case.source).name for case in cases)}
    silent: tuple[str, ...] = ()
    if rig.motion == "measured":
        silent = ("spring_end.",) if "ft" in channels else ("spring_end.", "spring.")
    tells = (u for u in unknowns_of_rig(rig) if not u.name.startswith(silent))
    of_rig = [u for u in tells if not own or any(u.name not in values for values in own)]
    return (
        *(u for u in of_rig if u.name.partition("@")[2] in records),
        *(u for group in effects for u in group),
        *(clocks(channels, rig) if not is_inverse(rig) else ()),
    )


SCATTER = 0.005
"""Of a period, RMS: what scatters less is taken as stamped right."""
_FARTHEST = 0.45
"""Of a period: a stamp further off an even clock could belong to another sample."""
_SURE = 4.0
"""Standard deviations of a period, up to which it may be that of all others: one clock makes them."""
_ONE_SIDED = 1.0
"""Skewness of stamps of arrival: an exponential delay has 2, even scatter 0, of 280 samples to 0.15."""
_EARLIEST, _AHEAD = 0.01, 8
"""Share of the stamps of arrival before their edge; stamps ahead of which the earliest dates a sample."""
_SCATTERED, _MANY = 0.5, 64
"""Of a step, between the quartiles of all: then its median is no longer the period. Samples."""
_FALL = 0.8
"""Of the residual at the stamps: the even clock must leave less."""
_NO_WORSE = 1.02
"""Of a sensor's residual: an even clock of the command that raises it by more is not the one that acted."""
_TINY = 1e-30


@dataclass(frozen=True)
class Evened:
    """Records on the even clock where that is right, and the RMS scatter of its stamps, s by channel."""

    records: tuple[Record, ...]
    scatter: Mapping[str, float]

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Return remarks on the changes; empty where no stamps scatter."""
        names = tuple(sorted(self.scatter))
        return (Remark("even_clocks", names, tuple(self.scatter[n] for n in names)),) if names else ()


def even_out(records: Sequence[Record], rig: Rig, solution: Solution) -> Evened:
    """Return the records with an even clock for each channel whose residual under a solution prefers it."""
    if is_inverse(rig):
        return Evened(tuple(records), {})
    scatter: dict[str, float] = {}
    result = []
    for record in records:
        steady, sizes = _on_even_clocks(record)
        chosen = _prefer_even(record, steady, sizes.keys(), rig, solution) if sizes else set()
        scatter |= {n: max(sizes[n], scatter.get(n, 0.0)) for n in chosen}
        result.append(_with_channels_of(record, steady, chosen))
    return Evened(tuple(result), scatter)


def even_clock(t: FloatArray, shared: float = 0.0) -> FloatArray:
    """Return the stamps of an even clock that come nearest to t, s, shape of t; samples may be missing.

    shared: period of all channels, s: used where the stamps do not contradict it, because it is surer.
    Stamps of arrival are late by a delay with a tail: their earliest are nearest to the clock.
    Returns t itself where no even clock is near all of it, or where t is already even.
    """
    line = _line(t)
    period = shared if abs(line.period - shared) < _SURE * line.doubt else line.period
    even = period * line.place + float(np.mean(t - period * line.place))
    (usual, _), off = _usual_step(t), t - even
    late = float(np.mean(off**3)) > _ONE_SIDED * max(float(np.mean(off**2)), _TINY) ** 1.5
    early = float(np.quantile(off, _EARLIEST)) if late else 0.0
    is_whole = late and line.place[-1] == len(t) - 1  # their order alone tells which is which
    farthest = 0.0 if is_whole else -early if late else line.farthest
    if farthest > _FARTHEST * usual or line.scatter < SCATTER * usual:
        return t
    return np.asarray(even + early)


@dataclass(frozen=True)
class _StampFit:
    """Stamps over the number of their sample, by least squares: period and its one sigma, s.

    place: the number of each sample. farthest, scatter: largest and RMS distance of a stamp from it, s.
    """

    place: FloatArray
    period: float
    doubt: float
    farthest: float
    scatter: float


def _usual_step(t: FloatArray) -> tuple[float, int]:
    """Return the usual time between samples, s, and of how many the earliest stamp dates one.

    Of many where stamps scatter by much of a step: then the median of the steps is not the period.
    """
    low, usual, high = (float(q) for q in np.quantile(np.diff(t), (0.25, 0.5, 0.75)))
    if high - low < _SCATTERED * usual or len(t) < 2 * _MANY:
        return usual, _AHEAD
    return float(np.median(t[_MANY:] - t[:-_MANY])) / _MANY, _MANY


def _line(t: FloatArray) -> _StampFit:
    usual, count = _usual_step(t)
    ahead = np.pad(t - usual * np.arange(len(t)), (0, count - 1), constant_values=np.inf)
    earliest = np.lib.stride_tricks.sliding_window_view(ahead, count).min(axis=1)  # of the next few stamps
    place = np.concatenate([[0.0], np.cumsum(np.round(np.diff(earliest) / usual + 1.0))])
    period, first = np.polyfit(place, t, 1)
    off = np.abs(t - (first + period * place))
    scatter = float(np.sqrt(np.mean(off**2)))
    doubt = scatter / (float(np.std(place)) * float(np.sqrt(len(place))))
    return _StampFit(place, float(period), doubt, float(off.max()), scatter)


def _shared_period(record: Record) -> float:
    """Return the period, s, of all channels that may have the one of the surest, each by its doubt."""
    lines = [_line(c.t) for n, c in record.channels.items() if n != "reference"]
    best = min(lines, key=lambda line: line.doubt)
    alike = [x for x in lines if abs(x.period - best.period) <= _SURE * np.hypot(x.doubt, best.doubt)]
    return float(np.average([x.period for x in alike], weights=[1.0 / (x.doubt**2 + _TINY) for x in alike]))


def _on_even_clocks(record: Record) -> tuple[Record, dict[str, float]]:
    """Return a record on even clocks, and the RMS scatter of the channels that changed, s."""
    shared = _shared_period(record)
    clocks = {n: even_clock(c.t, shared) for n, c in record.channels.items() if n != "reference"}
    changed = {n: t for n, t in clocks.items() if t is not record[n].t}
    steady = record.with_channels(**{n: Channel(t, record[n].y) for n, t in changed.items()})
    return steady, {n: float(np.std(record[n].t - t)) for n, t in changed.items()}


def _with_channels_of(record: Record, steady: Record, names: Collection[str]) -> Record:
    """Return the record with some channels as they are on even clocks."""
    return record.with_channels(**{n: steady[n] for n in names})


def _prefer_even(
    record: Record, steady: Record, changed: Collection[str], rig: Rig, solution: Solution
) -> set[str]:
    """Return the channels with a smaller residual on the even clock: each sensor, the command by all."""
    sensors = set(changed) - {"command"}
    chosen, stamped = _sensors_preferred(record, steady, sensors, rig, solution)
    if "command" not in changed:
        return chosen
    driven = _with_channels_of(record, steady, ["command"])
    others, even = _sensors_preferred(driven, steady, sensors, rig, solution)
    falls = [even[n] / max(stamped[n], _TINY) for n in stamped.keys() & even.keys() - {"motor_torque"}]
    return {"command", *others} if falls and min(falls) < _FALL and max(falls) < _NO_WORSE else chosen


def _sensors_preferred(
    record: Record, steady: Record, sensors: set[str], rig: Rig, solution: Solution
) -> tuple[set[str], dict[str, float]]:
    """Return the sensors with a smaller residual on the even clock, and the residual of every sensor then."""
    stamped = _residual_rms(record, rig, solution)
    if not sensors:
        return set(), stamped
    even = _residual_rms(_with_channels_of(record, steady, sensors), rig, solution)
    chosen = {n for n in sensors & stamped.keys() & even.keys() if even[n] < _FALL * stamped[n]}
    return chosen, {**stamped, **{n: even[n] for n in chosen}}


def _residual_rms(record: Record, rig: Rig, solution: Solution) -> dict[str, float]:
    """Return by channel the RMS that a solution leaves of a record, means and a constant lag aside."""
    case = case_from(record, rig)
    (outputs,) = replace(solution.problem, cases=(case,)).outputs(solution.theta)
    present = solution.problem.present(case)
    return {n: _without_lag(outputs[n], case.measured[n], case.t[n], case.mask[n]) for n in present}


def _without_lag(p: FloatArray, y: FloatArray, t: FloatArray, counts: BoolArray) -> float:
    """Return the RMS of p - y without its mean and without what a constant lag of y makes of it."""
    slope, off = np.gradient(p, t)[counts], (p - y)[counts]
    slope, off = slope - slope.mean(), off - off.mean()
    return float(np.std(off - slope * (slope @ off) / max(float(slope @ slope), _TINY)))


def with_even_clocks(
    records: Sequence[Record], masked: Sequence[Mapping[str, BoolArray]], rig: Rig
) -> Evened:
    """Return records on the even clocks that a fit of the rig prefers; as they are where no stamps scatter.

    masked: samples that do not count, by channel, of each record.
    """
    steady = Evened(tuple(records), {})
    if is_inverse(rig) or not any(_on_even_clocks(record)[1] for record in records):
        return steady
    while True:
        cases = [case_from(r, rig, bad) for r, bad in zip(steady.records, masked, strict=True)]
        more = even_out(steady.records, rig, fit(cases, rig)[0])
        if not more.scatter:
            return steady
        steady = Evened(more.records, {**steady.scatter, **more.scatter})


LAWS = ("torque_constant_error", "command_delay", "current_loop_lag", "coulomb_friction", "ft_gain_error")
"""What is wrong most often and biases the values of the rig most, one number each."""
FALL = 0.1
"""Of the cost: an alternative that takes away less explains nothing of the misfit."""
NEAR = 2.0
"""Times the cost of the best alternative, up to which another is credible beside it."""
_ITERATIONS = 10


@dataclass(frozen=True)
class ExtendedFit:
    """A law that the rig does not list, and the fit with it. times_noise: residual of the worst channel."""

    name: str
    solution: Solution
    confidence: Confidence
    times_noise: float

    def interval(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of an unknown, SI."""
        unknowns = self.solution.problem.unknowns
        i = [u.name for u in unknowns].index(name)
        sd = float(np.sqrt(self.confidence.covariance[i, i]))
        return interval(unknowns[i], float(self.solution.theta[i]), sd)


def add_effect(
    present: Problem, theta: FloatArray, effect: Effect, start: dict[str, float]
) -> tuple[Problem, FloatArray]:
    """Return the present problem with one more effect whose parameters may move, and its start."""
    unknowns = (*present.unknowns, *unknowns_of_effect(effect, start, idle(effect, present.rig)))
    rig = with_effect(present.rig, effect.name, start)
    problem = replace(present, rig=rig, unknowns=unknowns, newest=effect.name)
    return problem, np.concatenate([theta, start_vector(problem.unknowns)[len(theta) :]])


def alternatives(solution: Solution, cases: Sequence[Case], pools: Pools) -> tuple[ExtendedFit, ...]:
    """Return the laws that would explain a part of a solution's residual, the best first.

    cases: with the noise of their sensors, not with weights from the misfit.
    """
    problem = solution.problem
    if is_inverse(problem.rig):
        return ()
    acting, scale = {e.name for e in problem.rig.effects}, scale_of(problem.cases, problem.rig)
    names = [n for n in LAWS if n not in acting]
    tried = pools.fits.map(lambda n: _fit_with(solution, effect_named(n).at(scale), pools.run), names)
    fitted = [(n, s) for n, s in zip(names, tried, strict=True) if s is not None]
    fitted = [(n, s) for n, s in fitted if s.cost < (1.0 - FALL) * solution.cost]
    best = min((s.cost for _, s in fitted), default=0.0)
    credible = sorted(((n, s) for n, s in fitted if s.cost <= NEAR * best), key=lambda item: item[1].cost)
    return tuple(pools.fits.map(lambda law: _refit(law[0], law[1], cases, pools.run), credible))


def _fit_with(solution: Solution, effect: Effect, run: Map) -> Solution | None:
    """Return the fit with one more effect; None where the rig cannot have it."""
    try:
        clocks = np.array([u.is_clock for u in solution.problem.unknowns])
        theta = np.where(clocks, 0.0, solution.theta)  # beside a misfit they run to their bounds
        problem_and_start = add_effect(solution.problem, theta, effect, effect.typical)
        return solve(*problem_and_start, iterations=_ITERATIONS, run=run)
    except RseaError:
        return None


def _refit(name: str, solution: Solution, cases: Sequence[Case], run: Map) -> ExtendedFit:
    """Return an alternative fitted again, every channel in units of its residual or its noise."""
    known = replace(solution.problem, cases=tuple(cases))
    ratios = misfit_ratios(replace(solution, problem=known))
    weighted = tuple(reweight(case, ratios) for case in cases)
    settled = solve(replace(known, cases=weighted), solution.theta, iterations=_ITERATIONS, run=run)
    left = max(misfit_ratios(replace(settled, problem=known)).values())
    return ExtendedFit(name, settled, confidence_of(settled, run), left)


def span_all(ci95: tuple[float, float], name: str, others: Sequence[ExtendedFit]) -> tuple[float, float]:
    """Return an interval of a parameter widened to hold its intervals under the alternatives, SI."""
    every = [ci95, *(other.interval(name) for other in others)]
    return min(low for low, _ in every), max(high for _, high in every)
