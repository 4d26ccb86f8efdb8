"""A law's parameters by output error in the compiled step, beside the rig's, and their gain."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rsea_ros.diagnosis.data_split import TRAIN, VALIDATION
from rsea_ros.diagnosis.problem_variants import on_blocks
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import lend
from rsea_ros.effects.effect import Effect
from rsea_ros.identification.confidence import confidence_of, interval
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, solve
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.model.rig import EffectSetting
from rsea_ros.outputs.files import write_new
from rsea_ros.plugins import plugin_constant

_ITERATIONS = 12


@dataclass(frozen=True)
class Refined:
    """A problem with laws acting, fitted. ci95: of every unknown by name."""

    solution: Solution
    ci95: Mapping[str, tuple[float, float]]

    def parameters(self, name: str) -> dict[str, float]:
        """Return the parameters of one law, held ones included."""
        values = self.solution.values
        acting = next(e for e in self.solution.problem.rig.effects if e.name == name)
        return {n: values.get(f"{name}.{n}", v) for n, v in acting.parameters.items()}


def effect_from(source: str, name: str) -> Effect:
    """Return the effect of a text as a file's would be loaded."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.py"
        write_new(path, source)
        return plugin_constant("law", str(path), "EFFECT", Effect)


@contextmanager
def register(effects: Sequence[Effect]) -> Iterator[None]:
    """Have laws known to the simulation within the block."""
    with lend(*effects):
        yield


def with_laws(
    problem: Problem, laws: Sequence[tuple[Effect, Mapping[str, float]]], held: frozenset[str] = frozenset()
) -> Problem:
    """Return a problem with laws acting and their parameters unknown; not those of `held`."""
    settings = [EffectSetting(e.name, dict(p)) for e, p in laws]
    rig = problem.rig.with_effects(*problem.rig.effects, *settings)
    more = [u for e, p in laws for u in unknowns_of_effect(e, p, held)]
    return replace(problem, rig=rig, unknowns=(*problem.unknowns, *more))


def refine(
    base: Solution, cases: Sequence[Case], weights: Score, laws: Sequence[tuple[Effect, Mapping[str, float]]],
    held: frozenset[str] = frozenset(),
) -> Refined:  # fmt: skip
    """Fit a base model's values and its laws' parameters to all blocks but the test blocks.

    weights: a score whose misfit counts as noise. Creep velocities stay as they are.
    """
    creeps = {f"{e.name}.creep_velocity" for e, _ in laws}
    problem = with_laws(base.problem, laws, frozenset(creeps) | held)
    start = np.concatenate([base.theta, start_vector(problem.unknowns[len(base.theta) :])])
    blocks = on_blocks(problem, cases, (*TRAIN, *VALIDATION), weights, DEFAULT.blocks)
    solution = solve(blocks, start, iterations=_ITERATIONS, gain=1e-4)
    confidence = confidence_of(solution)
    sd = np.sqrt(np.diag(confidence.covariance))
    ci95 = {
        u.name: interval(u, float(at), float(s))
        for u, at, s in zip(solution.problem.unknowns, solution.theta, sd, strict=True)
    }
    return Refined(solution, ci95)
