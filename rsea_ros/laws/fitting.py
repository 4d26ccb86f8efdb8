"""Laws fitted in the simulation, without needless terms, and their gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.score import Score, score_on
from rsea_ros.diagnosis.score import gain_of as gain_of_blocks
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.effect import Effect
from rsea_ros.laws.choice import FITTED, Base
from rsea_ros.laws.file import Draft, Refined, refine

_NEEDED = 0.03
"""Of what is left: a term without which the fit leaves no more than that is left out."""


def refined_laws(base: Base, drafts: Sequence[Draft]) -> Refined:
    """Fit the laws in the simulation, in units of their residual, and drop needless terms."""
    refined = refine(base.solution, base.cases, base.score(FITTED), _starts(drafts, None))
    weights = _score(base, refined, FITTED)
    refined = _again(base, drafts, refined, weights, frozenset())
    held: frozenset[str] = frozenset()
    while (names := _least(drafts, refined, held)) is not None:
        fewer = _again(base, drafts, refined, weights, held | names)
        if fewer.solution.cost > (1.0 + _NEEDED) * refined.solution.cost:
            break
        refined, held = fewer, held | names
    return refined


def _starts(drafts: Sequence[Draft], refined: Refined | None) -> list[tuple[Effect, dict[str, float]]]:
    if refined is None:
        return [(d.effect, d.law.parameters) for d in drafts]
    return [(d.effect, refined.parameters(d.effect.name)) for d in drafts]


def _again(
    base: Base, drafts: Sequence[Draft], refined: Refined, weights: Score, held: frozenset[str]
) -> Refined:
    """Fit from a fit on, with some parameters held: coefficients at zero, shapes where they are."""
    nearer = replace(base.solution, theta=refined.solution.theta[: len(base.solution.theta)])
    starts = [
        (e, {n: 0.0 if f"{e.name}.{n}" in held and _is_size(d, n) else v for n, v in values.items()})
        for d, (e, values) in zip(drafts, _starts(drafts, refined), strict=True)
    ]
    return refine(nearer, base.cases, weights, starts, held)


def _is_size(draft: Draft, name: str) -> bool:
    return name in {c for c, _ in draft.law.names}


def _least(drafts: Sequence[Draft], refined: Refined, held: frozenset[str]) -> frozenset[str] | None:
    """Return the parameters of the term of least significance, its shape too where no other has it."""
    terms = [
        (d.effect.name, c, s) for d in drafts for c, s in d.law.names if f"{d.effect.name}.{c}" not in held
    ]
    if len(terms) < 2:
        return None

    def significance(term: tuple[str, str, str]) -> float:
        name = f"{term[0]}.{term[1]}"
        low, high = refined.ci95[name]
        return abs(refined.solution.values[name]) / max(high - low, 1e-300)

    effect, c, s = min(terms, key=significance)
    shared = any(other != c and shape == s for e, other, shape in terms if e == effect)
    return frozenset({f"{effect}.{c}", *([f"{effect}.{s}"] if s and not shared else [])})


def _score(base: Base, refined: Refined, sets: tuple[int, ...]) -> Score:
    """Return the score of refined laws on some sets of blocks."""
    problem = replace(refined.solution.problem, cases=base.cases)
    return score_on(problem, base.cases, sets, problem.outputs(refined.solution.theta), DEFAULT.blocks)


def gain_on_tests(base: Base, refined: Refined) -> tuple[float, tuple[float, float]]:
    """Return the gain on the test blocks with its interval."""
    return gain_of(base.score(TEST), _score(base, refined, TEST))


def gain_of(without: Score, with_it: Score) -> tuple[float, tuple[float, float]]:
    """Return 1 - RMS(with) / RMS(without) of all channels together, and its 95 % bootstrap interval."""
    return gain_of_blocks(with_it.loss(without), without.loss(without))


def share_of(before: dict[str, float], after: dict[str, float], noise: dict[str, float]) -> float:
    """Return the explained share of the power above the noise, over the channels that had any."""
    shares = [
        ((before[n] ** 2 - after[n] ** 2), before[n] ** 2 - noise[n] ** 2)
        for n in before
        if before[n] > DEFAULT.floor.reached * noise[n]
    ]
    return sum(a / b for a, b in shares) / len(shares) if shares else 0.0
