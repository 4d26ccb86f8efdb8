"""Variants of a problem: on some blocks, in other units, on longer steps, without clocks or an effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.data_split import part
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import BlockSettings
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.model.drive import Drive, coarser
from rsea_ros.records.record import FloatArray


def on_blocks(
    problem: Problem, cases: Sequence[Case], blocks: tuple[int, ...], weights: Score | None,
    rule: BlockSettings,
) -> Problem:  # fmt: skip
    """Return a problem on some blocks of the cases.

    weights: a score of these cases whose misfit counts as noise.
    """
    weighted = cases if weights is None else in_units_of(weights, cases)
    return replace(problem, cases=tuple(part(c, blocks, rule) for c in weighted))


def in_units_of(weights: Score, cases: Sequence[Case]) -> tuple[Case, ...]:
    """Return the cases of a score with each run's residual of a channel as its noise, where it is larger.

    A model that misfits errs more in one run than in another, and not as their sensors' noise does.
    """
    return tuple(_with_misfit_as_noise(case, weights.ratios_in(k)) for k, case in enumerate(cases))


def _with_misfit_as_noise(case: Case, misfit: Mapping[str, float]) -> Case:
    noise = {n: s * max(1.0, misfit[n]) if n in misfit else s for n, s in case.noise.items()}
    return replace(case, noise=noise)


def with_doubled_step(problem: Problem) -> Problem:
    """Return a problem on steps twice as long: half the cost, for models far from the floor."""
    drives = (coarser(c.drive) if isinstance(c.drive, Drive) else c.drive for c in problem.cases)
    return replace(
        problem, cases=tuple(replace(c, drive=d) for c, d in zip(problem.cases, drives, strict=True))
    )


def without_effect(problem: Problem, theta: FloatArray, name: str) -> tuple[Problem, FloatArray]:
    """Return a problem without one of its effects, and theta without its parameters."""
    keep = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(name + ".")]
    rig = problem.rig.with_effects(*(e for e in problem.rig.effects if e.name != name))
    newest = "" if problem.newest == name else problem.newest
    unknowns = tuple(problem.unknowns[i] for i in keep)
    return replace(problem, rig=rig, unknowns=unknowns, newest=newest), theta[keep]


def without_clocks(problem: Problem, theta: FloatArray) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with all clocks taken as right.

    Beside a misfit far above the noise the clocks only run to their bounds and lead the search astray.
    """
    keep = [i for i, u in enumerate(problem.unknowns) if not u.is_clock]
    return replace(problem, unknowns=tuple(problem.unknowns[i] for i in keep)), theta[keep]


def with_clocks(problem: Problem, theta: FloatArray, model: Problem) -> tuple[Problem, FloatArray]:
    """Return a problem and its theta with the clocks of another problem free again, at zero."""
    clocks = tuple(u for u in model.unknowns if u.is_clock)
    larger = replace(problem, unknowns=(*problem.unknowns, *clocks))
    return larger, np.concatenate([theta, np.zeros(len(clocks))])


def with_common_clock_in_delay(solution: Solution) -> FloatArray | None:
    """Return theta with the clock error that all sensors share converted into a delay of the command.

    Where a delay is a whole number of samples the residual has a kink, and a fit may stop there with the
    rest in the clocks. None for a model without a delay.
    """
    names = [u.name for u in solution.problem.unknowns]
    clocks = [i for i, u in enumerate(solution.problem.unknowns) if u.is_clock and not u.is_rate]
    acting = [e for e in map(effect_named, solution.problem.acting) if "delay" in e.tags]
    delay = next((d for d in (f"{e.name}.{e.main.name}" for e in acting) if d in names), None)
    if delay is None or not clocks:
        return None
    theta = solution.theta.copy()
    common = float(np.mean(theta[clocks]))
    theta[clocks] -= common
    theta[names.index(delay)] -= common
    return np.asarray(theta)
