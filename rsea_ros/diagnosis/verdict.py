"""The verdict: from how the first and the last model do on data that judge, and what may be named."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.evaluation import Stage
from rsea_ros.diagnosis.judge import MATTERS
from rsea_ros.diagnosis.result import Status, Verdict

FLOOR = 1.1
"""RMS of the residual over the noise, held out, up to which a model has reached the noise floor."""

MISFIT = 1.5
"""RMS of the residual over the noise above which a channel misfits."""
MUCH = 3.0
"""RMS of the residual over the noise above which a channel misfits much."""
HALF = 0.5
"""What may be left of a misfitting channel's residual where causes take most of it."""


def verdict_of(stages: Sequence[Stage], statuses: Sequence[Status | None] = ()) -> Verdict:
    """Return the verdict: see contract.md, diagnosis.json.

    statuses: of the cause that each stage adds to the one before, None for one that is not to be named.
    """
    if not any(statuses):
        return "nothing_wrong" if reached(stages[0].judged) else "unexplained"
    confirmed = all(status == "confirmed" for status in statuses)
    return "explained" if confirmed and reached(stages[-1].judged) else "partly_explained"


def takes_most(first: Score, last: Score) -> bool:
    """Tell whether causes take half of the residual in every channel that misfits, or all of one that misfits
    much without adding to another. A change that does not matter (judge.py) is none."""
    misfitting = [n for n in first.sums if first.ratio(n) > MISFIT]
    falls = [last.ratio(n) / first.ratio(n) for n in misfitting]
    explained = [n for n in misfitting if first.ratio(n) > MUCH and last.ratio(n) < MISFIT]
    return bool(falls) and (max(falls) < HALF or (bool(explained) and max(falls) <= 1.0 + MATTERS))


def reached(judged: Score) -> bool:
    """Tell whether every channel is at its noise floor."""
    return all(judged.ratio(n) <= FLOOR for n in judged.sums)
