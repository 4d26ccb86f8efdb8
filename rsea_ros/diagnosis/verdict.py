"""The verdict: from how the first and the last model do on data that judge."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.evaluation import Stage
from rsea_ros.diagnosis.result import Verdict
from rsea_ros.diagnosis.stepwise import Search

FLOOR = 1.1
"""RMS of the residual over the noise, held out, up to which a model has reached the noise floor."""
MISFIT = 1.5
"""RMS of the residual over the noise above which a channel misfits."""
MUCH = 3.0
"""RMS of the residual over the noise above which a channel misfits much."""
HALF = 0.5
"""What may be left of a misfitting channel's residual for causes to be named without reaching the floor."""


def verdict_of(found: Search, stages: Sequence[Stage]) -> Verdict:
    """Return the verdict: see contract.md, diagnosis.json."""
    first, last = stages[0].judged, stages[-1].judged
    if len(stages) == 1:
        return "nothing_wrong" if reached(first) else "unexplained"
    if reached(last):
        return "explained"
    return "partly_explained" if is_trusted(found, first, last) else "unexplained"


def reached(judged: Score) -> bool:
    """Tell whether every channel is at its noise floor."""
    return all(judged.ratio(n) <= FLOOR for n in judged.sums)


def is_trusted(found: Search, first: Score, last: Score) -> bool:
    """Tell whether causes may be named although the floor is not reached.

    What is not in the catalogue often looks a little like something that is. A cause is named only if it
    takes away half of the residual in every channel that misfits, or all of one that misfits much
    without adding to another, and nothing else does as well as the first.
    """
    if found.rivals_of(found.last.causes[0]):
        return False
    misfitting = [n for n in first.sums if first.ratio(n) > MISFIT]
    falls = [last.ratio(n) / first.ratio(n) for n in misfitting]
    explained = [n for n in misfitting if first.ratio(n) > MUCH and last.ratio(n) < MISFIT]
    return bool(falls) and (max(falls) < HALF or (bool(explained) and max(falls) <= 1.0))
