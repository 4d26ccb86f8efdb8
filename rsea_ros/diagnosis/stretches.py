"""The stretches of a long record that a diagnosis fits and tests on, so that its cost has an end.

A record is cut into slots of whole blocks, four by four: each slot holds training, validation and test blocks
in their shares. Of a record with more slots than `settings.stretches` has room for, half of the slots are
spread evenly from its beginning to its end, for what changes slowly; the others are those that the nominal
model simulates worst, for what acts rarely. Times stay those of the record: blocks, drifts and clocks are as
in the whole of it. A channel that is faster than the commands keeps a sample per command.

Checks of the data and the first estimate of the noise see the whole record.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from rsea_ros.diagnosis import data_split as split
from rsea_ros.diagnosis.candidate import FitSetup, fit_candidate
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.result import Remark
from rsea_ros.identification.solver import Map
from rsea_ros.model.drive import LONGEST_STEP, Drive
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import build
from rsea_ros.records.record import FloatArray, IntArray

_ROUNDING = 1e-6
"""Of a slot: so much less is a whole one."""
_DECAYS = 4.0
"""Time constants of the rig's slowest motion that a run-up lasts: after 3 a sound rig with two swinging ends
is at its floor."""
_LASTS = 1e-5
"""Share of a motion that a step takes away, from which it ends within a record: 45 s."""


def in_stretches(problem: Problem, settings: DiagnosisSettings, run: Map) -> Problem:
    """Return a nominal problem on the stretches of its long records; itself where none is long."""
    if _is_whole(problem.cases, settings):
        return problem
    settings = settings_for(problem.rig, settings)
    thinner = replace(problem, cases=tuple(split.as_often_as_commands(c) for c in problem.cases))
    if _is_whole(thinner.cases, settings):
        return thinner
    whole = list(zip(thinner.cases, rooms(thinner.cases, settings), strict=True))
    spread = [spread_slots(slots_of(c, settings), (room + 1) // 2) for c, room in whole]
    outputs = _fitted_outputs(thinner, spread, settings, run)
    chosen = [
        on_slots(c, with_worst(slots, slot_misfits(c, out, settings), room), settings)
        for (c, room), slots, out in zip(whole, spread, outputs, strict=True)
    ]
    return replace(problem, cases=tuple(chosen))


def settings_for(rig: Rig, settings: DiagnosisSettings) -> DiagnosisSettings:
    """Return settings with a run-up in which a rig forgets its start, and slots that are no shorter."""
    rule = settings.stretches
    run_up = max(rule.run_up, _DECAYS * slowest_decay(rig))
    fours = math.ceil(max(run_up / settings.blocks.longest, rule.blocks) / 4)
    return replace(settings, stretches=replace(rule, run_up=run_up, blocks=4 * fours))


def slowest_decay(rig: Rig) -> float:
    """Return the longest time constant, s, of a rig's motions; those that never end are measured."""
    remaining = np.abs(np.linalg.eigvals(build(rig, LONGEST_STEP, 1.0).linear.phi))
    fading = remaining[(remaining > 0.0) & (remaining < 1.0 - _LASTS)]
    return max((-LONGEST_STEP / math.log(r) for r in fading), default=0.0)


def spread_over(case: Case, rig: Rig, settings: DiagnosisSettings) -> Case:
    """Return a case of a rig on slots that are spread evenly over it; itself where it is not long."""
    if _is_whole([case], settings):
        return case
    settings = settings_for(rig, settings)
    thinner = split.as_often_as_commands(case)
    (room,) = rooms([thinner], settings)
    return on_slots(thinner, spread_slots(slots_of(thinner, settings), room), settings)


def stretches_of(used: Problem, nominal: Problem, settings: DiagnosisSettings) -> tuple[Remark, ...]:
    """Return the remark on how much of its records a problem uses; none where that is all."""
    if not any(isinstance(c.drive, Drive) and c.drive.spans for c in used.cases):
        return ()
    suited = settings_for(nominal.rig, settings)
    seconds = sum(simulated_time(c, suited) for c in used.cases)
    return (Remark("stretches", values=(seconds, sum(c.duration for c in nominal.cases)), unit="s"),)


def rooms(cases: Sequence[Case], settings: DiagnosisSettings) -> list[int]:
    """Return how many slots of each case are used, their run-ups paid: one at least, all of short records."""
    rule = settings.stretches
    seconds = sum(c.duration for c in cases)
    samples = sum(max(map(len, c.t.values())) for c in cases)
    share = min(1.0, rule.enough / max(seconds, 1e-300), rule.samples / samples)
    if share == 1.0:
        return [slots_of(c, settings) for c in cases]
    paid = ((share * c.duration + rule.run_up) / (slot_length(c, settings) + rule.run_up) for c in cases)
    return [max(1, int(n)) for n in paid]


def slots_of(case: Case, settings: DiagnosisSettings) -> int:
    """Return how many slots a case has, one at least."""
    return max(1, int(case.duration / slot_length(case, settings) + _ROUNDING))


def spread_slots(slots: int, count: int) -> IntArray:
    """Return `count` of a number of slots, spread evenly, the first and the last among them."""
    return np.unique(np.linspace(0, slots - 1, count).round().astype(np.int64))


def with_worst(spread: IntArray, misfit: FloatArray, count: int) -> IntArray:
    """Return slots with those of the largest misfit beside them, `count` in all, in time."""
    others = np.array([k for k in np.argsort(-misfit, kind="stable") if k not in spread], np.int64)
    return np.sort(np.concatenate([spread, others[: max(0, count - len(spread))]]))


def slot_misfits(case: Case, outputs: Mapping[str, FloatArray], settings: DiagnosisSettings) -> FloatArray:
    """Return the power of a residual in each slot of a case, each channel over its power in all, summed."""
    length = slot_length(case, settings)
    slots = range(slots_of(case, settings))
    return np.array([split.misfit_between(case, outputs, k * length, length) for k in slots])


def slot_length(case: Case, settings: DiagnosisSettings) -> float:
    """Return the length of a slot of a case, s."""
    return settings.stretches.blocks * split.block_length(case, settings.blocks)


def on_slots(case: Case, slots: Sequence[int] | IntArray, settings: DiagnosisSettings) -> Case:
    """Return a case with the samples of some slots alone, simulated a run-up before and through them."""
    drive, length = case.drive, slot_length(case, settings)
    if not isinstance(drive, Drive) or len(slots) == slots_of(case, settings):
        return case
    times = [(a * length, b * length) for a, b in _runs(slots)]
    spans = tuple(_span(drive, a, b, settings.stretches.run_up) for a, b in times)
    anew = [(first, _state(case, drive, first)) for first, _ in spans if first > 0]
    since = {n: t - case.start for n, t in case.t.items()}
    keep = {n: np.any([(t >= a) & (t < b) for a, b in times], axis=0) for n, t in since.items()}
    cut = replace(
        drive, at={n: at[keep[n]] for n, at in drive.at.items()},
        restarts=tuple(sorted([*drive.restarts, *anew])), spans=spans,
    )
    return case.keep(keep, cut)


def simulated_time(case: Case, settings: DiagnosisSettings) -> float:
    """Return for how long a case is compared with its simulation, s."""
    drive = case.drive
    if not isinstance(drive, Drive) or not drive.spans:
        return case.duration
    run_up = settings.stretches.run_up
    return sum((end - first) * drive.step - run_up * (first > 0) for first, end in drive.spans)


def _fitted_outputs(
    problem: Problem, slots: Sequence[IntArray], settings: DiagnosisSettings, run: Map
) -> list[dict[str, FloatArray]]:
    """Return the channels on the whole records of a model that is fitted to some of their slots."""
    cases = tuple(on_slots(c, k, settings) for c, k in zip(problem.cases, slots, strict=True))
    model = fit_candidate(FitSetup(cases, settings, run), replace(problem, cases=cases))
    return problem.outputs(model.solution.theta)


def _is_whole(cases: Sequence[Case], settings: DiagnosisSettings) -> bool:
    """Return whether all slots of cases are used; a measured motion costs little and has no limit."""
    needed = (slots_of(c, settings) if isinstance(c.drive, Drive) else 0 for c in cases)
    return all(n <= room for n, room in zip(needed, rooms(cases, settings), strict=True))


def _runs(slots: Sequence[int] | IntArray) -> list[tuple[int, int]]:
    """Return first and end of each run of neighbouring slots."""
    slots = [int(k) for k in slots]
    breaks = [i for i, (a, b) in enumerate(pairwise(slots), start=1) if b != a + 1]
    return [(slots[a], slots[b - 1] + 1) for a, b in pairwise([0, *breaks, len(slots)])]


def _span(drive: Drive, begin: float, end: float, run_up: float) -> tuple[int, int]:
    """Return the steps from a run-up before a stretch to a command period behind it."""
    last = min(len(drive.command), math.ceil(end / drive.step) + drive.hold)
    return split.run_up_step(drive, begin, run_up), last


def _state(case: Case, drive: Drive, first: int) -> tuple[float, float]:
    """Return position (rad) and velocity (rad/s) before a step; the former since the start without a zero."""
    (position, velocity), (zero, _) = (split.state_at(case, drive.start + k * drive.step) for k in (first, 0))
    return position - zero * ("position" in case.floating), velocity
