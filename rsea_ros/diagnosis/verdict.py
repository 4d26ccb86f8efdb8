"""The verdict: from how the first and the last model do on data that judge, and what may be named."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.data_split import Score
from rsea_ros.diagnosis.evaluation import Stage
from rsea_ros.diagnosis.result import Status, Verdict

FLOOR = 1.1
"""RMS of the residual over the noise, held out, up to which a model has reached the noise floor."""


def verdict_of(stages: Sequence[Stage], statuses: Sequence[Status | None] = ()) -> Verdict:
    """Return the verdict: see contract.md, diagnosis.json.

    statuses: of the cause that each stage adds to the one before, None for one that is not to be named.
    """
    if not any(statuses):
        return "nothing_wrong" if reached(stages[0].judged) else "unexplained"
    confirmed = all(status == "confirmed" for status in statuses)
    return "explained" if confirmed and reached(stages[-1].judged) else "partly_explained"


def reached(judged: Score) -> bool:
    """Tell whether every channel is at its noise floor."""
    return all(judged.ratio(n) <= FLOOR for n in judged.sums)
