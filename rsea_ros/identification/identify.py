"""Identification: the parameters of a rig from records, by output error on all present channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.identification.alternatives import ExtendedFit, alternatives, span_all
from rsea_ros.identification.clocks import with_even_clocks
from rsea_ros.identification.confidence import (
    Confidence,
    confidence_of,
    torque_scale,
    undetermined_remarks,
)
from rsea_ros.identification.estimates import (
    errors_by_channel,
    identified_rig,
    off_rig,
    overlays_of,
    parameters_of,
)
from rsea_ros.identification.even_stamps import Evened, even_out
from rsea_ros.identification.fit import fit, ratios_of
from rsea_ros.identification.frequency_response import model_response, responses_of
from rsea_ros.identification.problem import Case, case_from
from rsea_ros.identification.record_checks import check_excited, check_usable
from rsea_ros.identification.result import (
    AT_NOISE,
    FrequencyResponse,
    Identification,
)
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.start import joint_start, start_from
from rsea_ros.identification.statics import statics_of
from rsea_ros.identification.workers import worker_pools
from rsea_ros.model.extent import bound_values
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.prediction_errors import fit_percent
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import FloatArray, Record


def identify(records: Sequence[Record], rig: Rig, progress: Progress | None = None) -> Identification:
    """Return the parameters of the rig, effects that it lists included, with their confidence.

    Raises IdentificationError when the records lack a channel that the rig needs.
    """
    report = progress or (lambda step, share: None)
    report("reading", 0.0)
    records = [with_command(record, rig) for record in records]
    for record in records:
        check_usable(record)
    records = [bound_values(record) for record in records]
    check_excited(records)
    cases = tuple(case_from(record, rig) for record in records)
    report("frequency responses", 0.2)
    responses = responses_of(records[0], rig)
    report("fitting", 0.4)
    with worker_pools() as pools:
        solution, cases, required = fit(cases, rig, run=pools.run, start=_start(records[0], rig, responses))
        steady, misfits = Evened(tuple(records), {}), _misfits(solution, cases)
        while misfits and (more := even_out(steady.records, rig, solution)).scatter:
            steady = Evened(more.records, {**steady.scatter, **more.scatter})
            cases = tuple(case_from(record, rig) for record in steady.records)
            solution, cases, required = fit(cases, rig, run=pools.run, start=identified_rig(solution, ()))
            misfits = _misfits(solution, cases)
        report("confidence", 0.8)
        outputs = solution.problem.outputs(solution.theta)
        others = alternatives(solution, cases, pools) if misfits else ()
        doubt = confidence_of(solution, pools.run)
    confidence = with_even_clocks(doubt, solution, records, steady.records)
    result = _result(solution, outputs, records, cases, responses, others, confidence)
    report("done", 1.0)
    return replace(
        result,
        remarks=(*steady.remarks, *result.remarks),
        clocks=required.remarks,
    )


def _start(record: Record, rig: Rig, responses: Sequence[FrequencyResponse]) -> Rig | None:
    """Return a start of the fit other than the rig's own values."""
    if is_inverse(rig):
        return None
    return start_from(responses, rig) if rig.loop is None else joint_start(record, rig)


def _misfits(solution: Solution, cases: Sequence[Case]) -> bool:
    """Return whether a solution leaves more than the noise of its cases."""
    outputs = solution.problem.outputs(solution.theta)
    return max(ratios_of(solution.problem, cases, outputs).values()) > AT_NOISE


def _result(
    solution: Solution,
    outputs: Sequence[dict[str, FloatArray]],
    records: Sequence[Record],
    cases: Sequence[Case],
    responses: tuple[FrequencyResponse, ...],
    others: Sequence[ExtendedFit],
    confidence: Confidence,
) -> Identification:
    """Gather the result. cases: with their noise, before any weight followed a misfit."""
    problem = solution.problem
    errors = errors_by_channel(problem, outputs)
    parameters = tuple(
        replace(p, ci95=span_all(p.ci95, p.name, others)) for p in parameters_of(solution, confidence)
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
        remarks=(
            *off_rig(parameters),
            *torque_scale(problem),
            *undetermined_remarks(problem.unknowns, confidence),
        ),
        notes=tuple(note for r in records for note in r.notes),
        faults=tuple(fault for r in records for fault in r.faults),
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
