"""The conclusion: verdict, causes with sizes and gains, what was rejected, what is left, what to run next."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.checks.faults import Checked
from rsea_ros.diagnosis.coherence import lost_above
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.evaluation import Evaluated
from rsea_ros.diagnosis.next_experiment import amplitude_series, separating
from rsea_ros.diagnosis.residual_analysis import misfits, spectrum
from rsea_ros.diagnosis.result import Cause, Diagnosis, Estimate, Experiment, Rejected, Verdict
from rsea_ros.diagnosis.score import Score, gain, score_on
from rsea_ros.diagnosis.selection import Selection, Trial
from rsea_ros.diagnosis.sentences import (
    coherence_lost,
    coloured_noise,
    evidence_of,
    on_measured_angle,
    verdict_sentence,
)
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.diagnosis.verdict import is_at_floor, verdict_of
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.confidence import what_is_not_told
from rsea_ros.identification.identify import fit_percent, identified_rig, overlays_of, parameters_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.identification.workers import Pools
from rsea_ros.model.rig import CLOCK_DOUBT, Rig
from rsea_ros.signals import Record

MODEL_DOUBT = 0.0025
"""Relative, one sigma: measured between the simulation and the second bench in test/independent."""
PRIMARY = ("ft", "deflection", "position", "velocity", "motor_torque")
"""The channel that gains and verdicts speak of: the first of these that is there."""


def diagnosis_of(
    selection: Selection,
    stages: list[Evaluated],
    checked: Sequence[Checked],
    records: Sequence[Record],
    rig: Rig,
    pools: Pools,
    settings: DiagnosisSettings,
) -> Diagnosis:
    """Return what a search and its judged stages come to; checked: of the records and the held-out one."""
    channel = next((n for n in PRIMARY if n in stages[0].test.sums), None)
    if channel is None:
        raise IdentificationError(
            f"{records[0].source}: no sample is left to judge by, expected a longer record"
        )
    faults = tuple(f for c in checked for f in c.faults)
    levels, causes_named = settings.floor, selection.last.causes
    has_rivals = bool(causes_named) and bool(selection.rivals_of(causes_named[0]))
    verdict = verdict_of([s.test for s in stages], has_rivals, levels, faults)
    dropped: list[Rejected] = []
    if verdict == "unexplained":
        channel = main_channel(stages[0].test, channel, levels.reached)
        dropped = [_dropped(a, b, channel) for a, b in itertools.pairwise(stages)]
        stages = stages[:1]
    first, last = stages[0], stages[-1]
    causes = tuple(_cause(selection, a, b, last, channel) for a, b in itertools.pairwise(stages))
    main = causes[0].channel if causes else channel
    named = {c.name for c in causes} | {r.name for r in dropped}
    others = [t for t in _latest(selection.trials) if t.name not in named]
    rejected = pools.fits.map(lambda t: _rejected(t, selection.cases, main), others)
    case = selection.cases[0]
    where = misfits(case, first.outputs[0], main, rig)
    baseline = parameters_of(first.solution, first.confidence)
    return Diagnosis(
        verdict=verdict,
        channel=main,
        sentence=verdict_sentence(
            verdict, causes, main, first.test.ratio(main), last.test.ratio(main), faults
        ),
        rig_name=rig.name,
        sources=tuple(r.source for r in records),
        duration=sum(r.stop - r.start for r in records),
        rate=records[0]["command"].rate,
        faults=faults,
        baseline_rig=identified_rig(first.solution, baseline),
        baseline=baseline,
        extended_rig=identified_rig(last.solution, parameters_of(last.solution, last.confidence)),
        noise_rms=dict(case.noise),
        residual_rms=_rms(first.test, case),
        fit_percent=_fit(first, selection.cases),
        extended_residual_rms=_rms(last.test, case),
        extended_fit_percent=_fit(last, selection.cases),
        at_noise_floor=is_at_floor(last.test, levels),
        misfit=where,
        causes=causes,
        rejected=(*dropped, *rejected),
        next_experiment=_next_experiment(selection, stages, verdict, records[0]),
        remaining=misfits(case, last.outputs[0], main, rig),
        masked=checked[0].masked,
        settings=settings,
        before=overlays_of(case, first.outputs[0]),
        after=overlays_of(case, last.outputs[0]),
        spectra=tuple(spectrum(case, first.outputs[0], last.outputs[0], n) for n in first.test.sums),
        statements=(
            *what_is_not_told(first.solution.problem.unknowns, first.confidence),
            *coherence_lost(lost_above(case, main), main),
            *on_measured_angle(last.solution.problem),
            *coloured_noise(sorted(case.coloured)),
        ),
    )


def main_channel(test: Score, channel: str, reached: float = DEFAULT.floor.reached) -> str:
    """Return the channel that shows an unexplained residual: `channel` if above noise, else the worst."""
    return channel if test.ratio(channel) > reached else test.worst


def _cause(
    selection: Selection, without: Evaluated, with_it: Evaluated, last: Evaluated, channel: str
) -> Cause:
    """Return an accepted cause: its parameters beside all causes, its own gain on data that took no part."""
    effect = effect_named(with_it.solution.problem.added[-1])
    speaks = (
        channel
        if without.test.ratio(channel) > 1.02 * with_it.test.ratio(channel)
        else max(without.test.sums, key=lambda n: without.test.ratio(n) / max(with_it.test.ratio(n), 1e-12))
    )
    held_out, interval = gain(with_it.test, without.test, speaks)
    train, _ = gain(with_it.train, without.train, speaks)
    estimates = {
        p.name.split(".")[1]: p
        for p in parameters_of(last.solution, last.confidence)
        if p.name.startswith(effect.name + ".")
    }
    return Cause(
        name=effect.name,
        parameters={k: with_model_uncertainty(e) for k, e in estimates.items()},
        gain_train=train,
        gain_holdout=held_out,
        gain_holdout_ci95=interval,
        evidence=evidence_of(
            effect, speaks, without.test.ratio(speaks), with_it.test.ratio(speaks), held_out
        ),
        equation=effect.equation,
        channel=speaks,
        confusable_with=tuple(m.newest for m in selection.rivals_of(effect.name)),
    )


def with_model_uncertainty(estimate: ParameterEstimate) -> Estimate:
    """Return an estimate whose interval also holds what no residual shows.

    The fit's interval speaks of noise alone. Two right simulations of one bench differ by about MODEL_DOUBT
    in what they make of a parameter (their steps, how they smooth a law), and no time is known better than
    the sensors' clocks. The interval of the noise alone stands beside the whole one.
    """
    value, sd = estimate.value, MODEL_DOUBT * abs(estimate.value)
    if estimate.unit == "s":
        sd = float(np.hypot(sd, CLOCK_DOUBT))
    low, high = (float(np.hypot(end - value, 1.96 * sd)) for end in estimate.ci95)
    return Estimate(value, estimate.unit, (value - low, value + high), estimate.ci95, sd)


def _next_experiment(
    selection: Selection, stages: Sequence[Evaluated], verdict: Verdict, record: Record
) -> Experiment | None:
    """Return the run that would tell what these data cannot; None when nothing is left to tell."""
    for stage in stages[1:]:
        rivals = selection.rivals_of(stage.solution.problem.added[-1])
        if rivals:
            return separating(stage.solution, [m.solution for m in rivals], record["command"].rate)
    if verdict in ("unexplained", "partly_explained") and not is_at_floor(stages[-1].test):
        return amplitude_series(float(np.nanmax(np.abs(record["command"].y))), stages[0].solution.problem.rig)
    return None


def _latest(trials: Sequence[Trial]) -> list[Trial]:
    """Return each effect's trial that says most: one fitted to everything, else the last."""
    best: dict[str, Trial] = {}
    for t in trials:
        if t.name not in best or t.is_full or not best[t.name].is_full:
            best[t.name] = t
    return list(best.values())


def _rejected(trial: Trial, cases: tuple[Case, ...], channel: str) -> Rejected:
    """Return a trial with its gain, on data that judge, over the model that it was tried beside."""
    problem = replace(trial.problem, cases=cases)
    with_it = score_on(problem, cases, TEST, problem.outputs(trial.theta))
    without = score_on(problem, cases, TEST, trial.beside.outputs)
    size = gain(with_it, without, channel)[0]
    return Rejected(trial.name, size, trial.reason, trial.rival, trial.is_full)


def _dropped(without: Evaluated, with_it: Evaluated, channel: str) -> Rejected:
    """Return an effect that was accepted and is no cause, for the verdict is `unexplained`."""
    name = with_it.solution.problem.added[-1]
    return Rejected(name, gain(with_it.test, without.test, channel)[0], "leaves_too_much")


def _rms(test: Score, case: Case) -> dict[str, float]:
    return {n: test.ratio(n) * case.noise[n] for n in test.sums}


def _fit(stage: Evaluated, cases: tuple[Case, ...]) -> dict[str, float]:
    """Return the fit of every channel on all samples that count, %."""
    case, out = cases[0], stage.outputs[0]
    keep = {n: case.mask[n] for n in stage.test.sums if n in case.measured}
    return {n: fit_percent((out[n] - case.measured[n])[k], case.measured[n][k]) for n, k in keep.items()}
