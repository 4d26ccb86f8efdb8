"""Identification: the parameters of a rig from records, by output error on all present channels.

Before a fit the channels must move, and the stamps rise. A record has the commands as they were published.
Where the computer was too busy for a cycle, the motor got none; the measured motor torque then differs from
the simulated one behind the gap, and less elsewhere. Any fault of the machine is as large elsewhere.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.identification import confidence as conf, fit as fits, result as results
from rsea_ros.identification.clocks import with_even_clocks
from rsea_ros.identification.frequency_response import model_response, responses_of
from rsea_ros.identification.problem import Case, case_from
from rsea_ros.identification.solver import Solution, worker_pools
from rsea_ros.identification.start import joint_start, start_from
from rsea_ros.model.extent import LARGEST, bound_values
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.prediction_errors import fit_percent
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Fault, FloatArray, Record
from rsea_ros.records.stamp_order import GAP


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


def check_excited(records: Sequence[Record]) -> None:
    """Raise IdentificationError where no record has a command that changes."""
    commands = [record["command"].y for record in records if "command" in record]
    if commands and all(len(y) == 0 or np.ptp(y) == 0.0 for y in commands):
        held = f"{commands[0][0]:.4g} N·m throughout" if len(commands[0]) else "empty"
        raise IdentificationError(
            f"{records[0].source}: torque_command is {held}, expected an excitation (chirp, multisine, noise)"
        )


KIND = "lost_cycles"
_FEWEST = 10
"""Gaps: the RMS behind fewer is known to worse than a quarter."""
_TIMES = 1.5
"""RMS behind gaps over that elsewhere, from which the gaps made it: twice what chance makes of ten gaps."""


def explained_by_lost_cycles(identification: results.Identification) -> int:
    """Return how many lost cycles are the likely cause of a misfit; 0 for another, and without misfit."""
    return 0 if identification.at_noise else lost_behind(identification.faults, identification.overlays)


def lost_behind(faults: Sequence[Fault], overlays: Sequence[results.Overlay]) -> int:
    """Return how many cycles were lost, if the motor torque of a misfit shows them; otherwise 0."""
    lost = round(sum(f.size or 0.0 for f in faults if f.kind == KIND))
    torque = next((o for o in overlays if o.channel == "motor_torque"), None)
    return lost if lost and torque is not None and rises_behind_gaps(torque) else 0


def rises_behind_gaps(overlay: results.Overlay) -> bool:
    """Return whether the residual is larger in the first sample behind a gap than in the others."""
    if len(overlay.t) < 2:
        return False
    step = np.diff(overlay.t)
    behind = np.concatenate([[False], step > GAP * float(np.median(step))])
    off = np.square(overlay.measured - overlay.simulated)
    known = np.isfinite(off)
    if np.count_nonzero(behind & known) < _FEWEST or not np.any(known & ~behind):
        return False
    return bool(np.mean(off[behind & known]) > _TIMES**2 * np.mean(off[known & ~behind]))


def identify(
    records: Sequence[Record], rig: Rig, progress: Progress | None = None, *, of_misfit: bool = True
) -> results.Identification:
    """Return the parameters of the rig, effects that it lists included, with their confidence.

    of_misfit: whether laws that would explain a misfit are fitted, too, and widen the intervals. Raises
    IdentificationError when the records lack a channel that the rig needs.
    """
    report = progress or (lambda step, share: None)
    report("reading", 0.0)
    records = [with_command(record, rig) for record in records]
    for record in records:
        check_usable(record)
    records = [bound_values(record) for record in records]
    check_excited(records)
    rig, unseen = fits.as_recorded(rig, records)
    cases = tuple(case_from(record, rig) for record in records)
    report("frequency responses", 0.2)
    responses = responses_of(records[0], rig)
    report("fitting", 0.4)
    with worker_pools() as pools:
        start = None
        if not is_inverse(rig) and rig.condition(records[0].source) is None:
            start = start_from(responses, rig) if rig.loop is None else joint_start(records[0], rig)
        solution, cases, required = fits.fit(cases, rig, run=pools.run, start=start)
        steady, misfits = fits.Evened(tuple(records), {}), _misfits(solution, cases)
        while misfits and (more := fits.even_out(steady.records, rig, solution)).scatter:
            steady = fits.Evened(more.records, {**steady.scatter, **more.scatter})
            cases = tuple(case_from(record, rig) for record in steady.records)
            start = conf.identified_rig(solution, ())
            solution, cases, required = fits.fit(cases, rig, run=pools.run, start=start)
            misfits = _misfits(solution, cases)
        report("confidence", 0.8)
        outputs = solution.problem.outputs(solution.theta)
        others = fits.alternatives(solution, cases, pools) if misfits and of_misfit else ()
        doubt = conf.confidence_of(solution, pools.run)
    confidence = with_even_clocks(doubt, solution, records, steady.records)
    result = _result(solution, outputs, records, cases, responses, others, confidence)
    report("done", 1.0)
    return replace(result, remarks=(*unseen, *steady.remarks, *result.remarks), clocks=required.remarks)


def _misfits(solution: Solution, cases: Sequence[Case]) -> bool:
    """Return whether a solution leaves more than the noise of its cases."""
    outputs = solution.problem.outputs(solution.theta)
    return max(fits.ratios_of(solution.problem, cases, outputs).values()) > results.AT_NOISE


def _result(
    solution: Solution, outputs: Sequence[dict[str, FloatArray]], records: Sequence[Record],
    cases: Sequence[Case], responses: tuple[results.FrequencyResponse, ...],
    others: Sequence[fits.ExtendedFit], confidence: conf.Confidence,
) -> results.Identification:  # fmt: skip
    """Gather the result. cases: with their noise, before any weight followed a misfit."""
    problem = solution.problem
    errors = conf.errors_by_channel(problem, outputs)
    times_noise = max(fits.ratios_of(problem, cases, outputs).values())
    left = min([times_noise, *(other.times_noise for other in others)])
    parameters = tuple(
        replace(p, ci95=fits.span_all(p.ci95, p.name, others), beside_misfit=left > results.FAR_FROM_NOISE)
        for p in conf.parameters_of(solution, confidence)
    )
    rig = conf.identified_rig(solution, parameters)
    first = rig.under(records[0].source)
    return results.Identification(
        rig=rig,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        parameters=parameters,
        alternatives=tuple(other.name for other in others),
        coloured=tuple(sorted({n for c in cases for n in c.coloured})),
        correlation=confidence.correlation,
        residual_rms={n: float(np.sqrt(np.mean(e**2))) for n, (e, _) in errors.items()},
        noise_rms={n: float(np.mean([c.noise[n] for c in cases if n in c.noise])) for n in errors},
        fit_percent={n: fit_percent(e, y) for n, (e, y) in errors.items()},
        responses=responses,
        models=tuple(model_response(first, r.output, r.frequency) for r in responses),
        overlays=conf.overlays_of(problem.cases[0], outputs[0]),
        statics=results.statics_of(records[0], rig),
        remarks=(
            *conf.off_rig(parameters),
            *conf.torque_scale(problem),
            *conf.stated_differences(problem),
            *conf.undetermined_remarks(problem.unknowns, confidence),
        ),
        notes=tuple(note for r in records for note in r.notes),
        faults=tuple(fault for r in records for fault in r.faults),
    )
