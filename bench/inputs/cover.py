"""A covering design: few cases in which every two values of any two factors meet."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

Case = dict[str, Any]
Pair = tuple[str, Any, str, Any]
_TRIED = 40
"""Random candidates for each case: more of them make the design a little smaller."""


def cover_pairs(
    factors: Mapping[str, Sequence[Any]], rng: random.Random, must: Sequence[Case] = ()
) -> tuple[list[Case], int]:
    """Return cases that hold every pair of values of two factors, and how many pairs that are.

    must: cases of which some values are given; each is filled up so that it brings new pairs.
    Sizes matter: a value that stands twice in a factor is drawn twice as often, a rare one seldom.
    """
    names = list(factors)
    left = {(a, x, b, y) for a, b in combinations(names, 2) for x in factors[a] for y in factors[b]}
    total, cases = len(left), []
    waiting = list(must)
    while waiting or left:
        given = waiting.pop() if waiting else _case_of(min(left, key=repr))
        drawn = [{n: given.get(n, rng.choice(factors[n])) for n in names} for _ in range(_TRIED)]
        best = max(drawn, key=lambda case: len(pairs(case, names) & left))
        left -= pairs(best, names)
        cases.append(best)
    return cases, total


def pairs(case: Case, names: Sequence[str]) -> set[Pair]:
    """Return the pairs of values that a case holds."""
    return {(a, case[a], b, case[b]) for a, b in combinations(names, 2)}


def _case_of(pair: Pair) -> Case:
    a, x, b, y = pair
    return {a: x, b: y}
