"""Identification: the parameters of a rig from records, by output error on all channels that are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.alternatives import Alternative, alternatives, spanned
from rsea_ros.identification.clock_doubt import with_even_clocks
from rsea_ros.identification.clocks import Asked, asked_of, freed, without_needless
from rsea_ros.identification.confidence import (
    Confidence,
    confidence_of,
    interval,
    torque_scale,
    what_is_not_told,
)
from rsea_ros.identification.even_stamps import Evened, evened
from rsea_ros.identification.joint_start import joint_start
from rsea_ros.identification.misfit import ratios_of, reweighted
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import Case, Problem, case_from
from rsea_ros.identification.responses import model_response, responses_of
from rsea_ros.identification.result import (
    AT_NOISE,
    FrequencyResponse,
    Identification,
    Overlay,
    ParameterEstimate,
)
from rsea_ros.identification.solver import Map, Solution, in_pool, serial, solve
from rsea_ros.identification.start import start_from
from rsea_ros.identification.statics import statics_of
from rsea_ros.identification.threads import one_blas_thread
from rsea_ros.identification.unknowns import (
    Unknown,
    apply,
    clocks,
    start_vector,
    unknowns_of_effect,
    unknowns_of_rig,
    vector_of,
)
from rsea_ros.identification.workers import cores
from rsea_ros.model.extent import LARGEST, bounded
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.position_loop import commanded
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.signals import FloatArray, Record
from rsea_ros.units import in_motion

CHANNELS = ("ft", "deflection", "position", "velocity", "motor_torque")
_MISFIT = 1.3
_REWEIGHTINGS = 3
_OTHER_NOISE = 1.1
"""Ratio of a channel's noise after a fit to that before, from which the fit is repeated."""


def identify(records: Sequence[Record], rig: Rig, progress: Progress | None = None) -> Identification:
    """Return the parameters of the rig, effects that it lists included, with their confidence.

    Raises IdentificationError when the records do not hold what the rig needs.
    """
    report = progress or (lambda step, share: None)
    report("reading", 0.0)
    records = [commanded(record, rig) for record in records]
    for record in records:
        check_usable(record)
    records = [bounded(record) for record in records]
    _check_excited(records)
    cases = tuple(case_from(record, rig) for record in records)
    report("frequency responses", 0.2)
    responses = responses_of(records[0], rig)
    report("fitting", 0.4)
    with one_blas_thread(), ThreadPoolExecutor(cores()) as pool:
        solution, cases, asked = fit(cases, rig, run=in_pool(pool), start=_start(records[0], rig, responses))
        steady, misfits = Evened(tuple(records), {}), _misfits(solution, cases)
        while misfits and (more := evened(steady.records, rig, solution)).scatter:
            steady = Evened(more.records, {**steady.scatter, **more.scatter})
            cases = tuple(case_from(record, rig) for record in steady.records)
            solution, cases, asked = fit(cases, rig, run=in_pool(pool), start=identified_rig(solution, ()))
            misfits = _misfits(solution, cases)
        report("confidence", 0.8)
        outputs = solution.problem.outputs(solution.theta)
        others = alternatives(solution, cases, in_pool(pool)) if misfits else ()
    confidence = with_even_clocks(confidence_of(solution), solution, records, steady.records)
    result = _result(solution, outputs, records, cases, responses, others, confidence)
    report("done", 1.0)
    return replace(
        result,
        statements=(*steady.sentences, *result.statements),
        clocks=asked.sentences,
    )


def _start(record: Record, rig: Rig, responses: Sequence[FrequencyResponse]) -> Rig | None:
    """Return where a fit may begin beside the rig's own values."""
    if is_inverse(rig):
        return None
    return start_from(responses, rig) if rig.loop is None else joint_start(record, rig)


def _misfits(solution: Solution, cases: Sequence[Case]) -> bool:
    """Tell whether a solution leaves more than the noise of its cases."""
    outputs = solution.problem.outputs(solution.theta)
    return max(ratios_of(solution.problem, cases, outputs).values()) > AT_NOISE


def check_usable(record: Record) -> None:
    """Raise IdentificationError for values that are not finite or stamps that do not rise."""
    for name, channel in record.channels.items():
        bad = ~((np.abs(channel.y) <= LARGEST) & np.isfinite(channel.t))
        if bad.any():
            k = int(np.argmax(bad))
            raise IdentificationError(
                f"{record.source}: {name}[{k}] at {channel.t[k]:.4f} s = {channel.y[k]}, "
                f"expected a finite value up to {LARGEST:g}"
            )
        back = np.diff(channel.t) <= 0.0
        if back.any():
            k = int(np.argmax(back)) + 1
            raise IdentificationError(
                f"{record.source}: {name} stamp {k} = {channel.t[k]:.6f} s after {channel.t[k - 1]:.6f} s, "
                "expected rising stamps"
            )


def _check_excited(records: Sequence[Record]) -> None:
    """Raise IdentificationError where no record has a command that changes."""
    commands = [record["command"].y for record in records if "command" in record]
    if commands and all(len(y) == 0 or np.ptp(y) == 0.0 for y in commands):
        held = f"{commands[0][0]:.4g} N m throughout" if len(commands[0]) else "empty"
        raise IdentificationError(
            f"{records[0].source}: torque_command is {held}, expected an excitation (chirp, multisine, noise)"
        )


def fit(
    cases: Sequence[Case], rig: Rig, run: Map = serial, start: Rig | None = None
) -> tuple[Solution, tuple[Case, ...], Asked]:
    """Fit the rig's free values, its effects and the clocks that the data ask for.

    Returns the cases with their noise too, and what was asked of the clocks.

    The noise is the one that the first fit's residual shows. Where a channel's residual stays above it the
    weight becomes that residual, as maximum likelihood with unknown noise has it. start: where to begin,
    should the records fit it better than `rig`.
    """
    unknowns = tuple(u for u in unknowns_of(rig, cases) if not u.is_clock)
    problem = Problem(tuple(cases), rig, unknowns, CHANNELS)
    solution = solve(problem, _better_start(problem, start, run), run=run)
    outputs = problem.outputs(solution.theta)
    known = _with_noise_of(problem, outputs)
    if _changed(problem.cases, known):
        solution = solve(replace(problem, cases=known), solution.theta, run=run)
        outputs = problem.outputs(solution.theta)
        known = _with_noise_of(solution.problem, outputs)
    asked = asked_of(solution, run)
    if asked.clocks:
        solution = solve(*freed(solution, asked), run=run)
        solution = solve(*without_needless(solution), run=run)
        problem = solution.problem
        outputs = problem.outputs(solution.theta)
        known = _with_noise_of(problem, outputs)
    for _ in range(_REWEIGHTINGS):
        ratios = ratios_of(problem, solution.problem.cases, outputs)
        if max(ratios.values()) < _MISFIT:
            break
        heavier = tuple(reweighted(c, ratios) for c in solution.problem.cases)
        solution = solve(replace(problem, cases=heavier), solution.theta, run=run)
        outputs = problem.outputs(solution.theta)
    return solution, known, asked


def _with_noise_of(problem: Problem, outputs: Sequence[dict[str, FloatArray]]) -> tuple[Case, ...]:
    """Return the cases with the noise that the residual of simulated outputs shows."""
    ratio = problem.rig["gear.ratio"]
    return tuple(reestimate_noise(c, out, ratio) for c, out in zip(problem.cases, outputs, strict=True))


def _changed(before: Sequence[Case], after: Sequence[Case]) -> bool:
    """Tell whether the noise of any channel has changed by more than a fit would notice."""
    ratios = [b.noise[n] / a.noise[n] for a, b in zip(before, after, strict=True) for n in a.noise]
    return any(not 1.0 / _OTHER_NOISE < r < _OTHER_NOISE for r in ratios)


def _better_start(problem: Problem, start: Rig | None, run: Map) -> FloatArray:
    """Return the coordinates of `start` where the residual is smaller there than at the rig's own values."""
    own = start_vector(problem.unknowns)
    if start is None:
        return own
    other = vector_of(problem.unknowns, start)
    costs = [float(r @ r) for r in run(lambda k: problem.residual((own, other)[k]), (0, 1))]
    return other if costs[1] < costs[0] else own


def unknowns_of(rig: Rig, cases: Sequence[Case]) -> tuple[Unknown, ...]:
    """Return all that a fit of these cases may move."""
    channels = sorted({n for case in cases for n in case.measured})
    effects = [unknowns_of_effect(effect_named(e.name), e.parameters, rig.known) for e in rig.effects]
    return (
        *unknowns_of_rig(rig),
        *(u for group in effects for u in group),
        *(clocks(channels, rig) if not is_inverse(rig) else ()),
    )


def _result(
    solution: Solution,
    outputs: Sequence[dict[str, FloatArray]],
    records: Sequence[Record],
    cases: Sequence[Case],
    responses: tuple[FrequencyResponse, ...],
    others: Sequence[Alternative],
    confidence: Confidence,
) -> Identification:
    """Gather the result. cases: with their noise, before any weight followed a misfit."""
    problem = solution.problem
    errors = errors_by_channel(problem, outputs)
    parameters = tuple(
        replace(p, ci95=spanned(p.ci95, p.name, others)) for p in parameters_of(solution, confidence)
    )
    rig = identified_rig(solution, parameters)
    return Identification(
        rig=rig,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        parameters=parameters,
        alternatives=tuple(other.name for other in others),
        coloured=tuple(sorted({n for c in cases for n in c.coloured})),
        correlation=confidence.correlation,
        residual_rms={n: _rms(e) for n, (e, _) in errors.items()},
        noise_rms={n: float(np.mean([c.noise[n] for c in cases if n in c.noise])) for n in errors},
        fit_percent={n: fit_percent(e, y) for n, (e, y) in errors.items()},
        responses=responses,
        models=tuple(model_response(rig, r.output, r.frequency) for r in responses),
        overlays=overlays_of(problem.cases[0], outputs[0]),
        statics=statics_of(records[0], rig),
        statements=(*torque_scale(problem), *what_is_not_told(problem.unknowns, confidence)),
        notes=tuple(note for r in records for note in r.notes),
        faults=tuple(fault for r in records for fault in r.faults),
    )


def errors_by_channel(
    problem: Problem, outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return by channel the error (simulated - measured) and the measured values, of samples that count."""
    parts: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for case, out in zip(problem.cases, outputs, strict=True):
        for n in problem.present(case):
            keep, y = case.mask[n], case.measured[n]
            parts.setdefault(n, []).append(((out[n] - y)[keep], y[keep]))
    return {
        n: (np.concatenate([e for e, _ in p]), np.concatenate([y for _, y in p])) for n, p in parts.items()
    }


def fit_percent(error: FloatArray, measured: FloatArray) -> float:
    """Return 100 (1 - ||e|| / ||y - mean y||), %."""
    scale = float(np.linalg.norm(measured - measured.mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(error)) / scale) if scale > 0.0 else 0.0


def parameters_of(solution: Solution, confidence: Confidence) -> tuple[ParameterEstimate, ...]:
    """Return the estimates of a fit with their 95 % intervals."""
    sd = np.sqrt(np.diag(confidence.covariance))
    return tuple(
        ParameterEstimate(
            name=u.name,
            value=u.outer(float(theta)),
            unit=in_motion(u.unit, linear=solution.problem.rig.linear),
            ci95=interval(u, float(theta), float(s)),
            start=u.start,
            spread=u.doubt,
            told_by_data=float(told),
        )
        for u, theta, s, told in zip(
            solution.problem.unknowns, solution.theta, sd, confidence.told, strict=True
        )
    )


def identified_rig(solution: Solution, parameters: Sequence[ParameterEstimate]) -> Rig:
    """Return the rig with what was fitted, its intervals, and its doubt as the next fit's spread."""
    rig, clocks = apply(solution.problem.rig, solution.problem.unknowns, solution.theta)
    sensors = {
        n: replace(
            s, clock=s.clock + clocks.offset.get(n, 0.0), clock_rate=s.clock_rate + clocks.rate.get(n, 0.0)
        )
        for n, s in rig.sensors.items()
    }
    quantities = dict(rig.quantities)
    for estimate in parameters:
        if estimate.name in quantities:
            quantities[estimate.name] = replace(
                quantities[estimate.name], ci95=estimate.ci95, source="identified"
            )
    return replace(rig, quantities=quantities, sensors=sensors)


def overlays_of(case: Case, outputs: Mapping[str, FloatArray]) -> tuple[Overlay, ...]:
    """Return measured beside simulated for every channel of a case."""
    return tuple(Overlay(n, case.t[n], case.measured[n], outputs[n]) for n in outputs)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
