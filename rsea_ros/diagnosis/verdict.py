"""The verdict: from the scores of the models on the test blocks, and the statuses of the causes."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.result import Status, Verdict
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, FloorSettings
from rsea_ros.identification.silent import silent_channels
from rsea_ros.signals import Fault


def verdict_of(
    scores: Sequence[Score],
    statuses: Sequence[Status | None] = (),
    levels: FloorSettings = DEFAULT.floor,
    faults: Sequence[Fault] = (),
) -> Verdict:
    """Return the verdict of models, from the nominal one to the one with all causes.

    scores: on the test blocks, one a model. statuses: of the cause that each model adds to the one before,
    None for one that is not named. faults: of the data. Where a sensor measures nothing, something is wrong
    that no effect explains (docs/decisions/0063-a-sensor-that-measures-nothing.md).
    `nothing_wrong` and `explained`: the residual is at the noise floor, without causes and with such as are
    all confirmed. `partly_explained`: causes are named although that is not so. `unexplained`: none is.
    """
    first, last = scores[0], scores[-1]
    if not any(statuses):
        is_fine = is_at_floor(first, levels) and not silent_channels(faults)
        return "nothing_wrong" if is_fine else "unexplained"
    is_whole = is_at_floor(last, levels) and all(status == "confirmed" for status in statuses)
    return "explained" if is_whole else "partly_explained"


def is_at_floor(test: Score, levels: FloorSettings = DEFAULT.floor) -> bool:
    """Tell whether every channel is at its noise floor."""
    return all(test.ratio(n) <= levels.reached for n in test.sums)


def takes_most(first: Score, last: Score, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Tell whether causes take half of the residual in every channel that misfits, or all of one.

    The latter counts where that one misfits much and no other gets worse by what matters.
    """
    levels, unchanged = settings.floor, 1.0 + settings.acceptance.matters
    misfitting = [n for n in first.sums if first.ratio(n) > levels.misfit]
    left = [last.ratio(n) / first.ratio(n) for n in misfitting]
    is_explained = any(
        first.ratio(n) > levels.large_misfit and last.ratio(n) < levels.misfit for n in misfitting
    )
    return bool(left) and (max(left) < levels.share_left or (is_explained and max(left) <= unchanged))
