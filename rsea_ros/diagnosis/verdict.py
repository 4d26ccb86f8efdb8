"""The verdict: from the scores of the first and the last model on the test blocks."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.result import Verdict
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT, FloorSettings
from rsea_ros.identification.silent import silent_channels
from rsea_ros.signals import Fault


def verdict_of(
    scores: Sequence[Score],
    has_rivals: bool,
    levels: FloorSettings = DEFAULT.floor,
    faults: Sequence[Fault] = (),
) -> Verdict:
    """Return the verdict of models, from the nominal one to the one with all causes.

    scores: on the test blocks, one a model. has_rivals: another effect does as well as the first cause.
    faults: of the data. Where a sensor measures nothing, something is wrong that no effect explains
    (docs/decisions/0063-a-sensor-that-measures-nothing.md).
    `nothing_wrong` and `explained`: the residual is at the noise floor, without and with causes.
    `partly_explained`: causes may be named although it is not. `unexplained`: none may.
    """
    first, last = scores[0], scores[-1]
    if len(scores) == 1:
        is_fine = is_at_floor(first, levels) and not silent_channels(faults)
        return "nothing_wrong" if is_fine else "unexplained"
    if is_at_floor(last, levels):
        return "explained"
    is_partly = not has_rivals and explains_enough(first, last, levels)
    return "partly_explained" if is_partly else "unexplained"


def is_at_floor(test: Score, levels: FloorSettings = DEFAULT.floor) -> bool:
    """Tell whether every channel is at its noise floor."""
    return all(test.ratio(n) <= levels.reached for n in test.sums)


def explains_enough(first: Score, last: Score, levels: FloorSettings = DEFAULT.floor) -> bool:
    """Tell whether causes may be named although the floor is not reached.

    What is not in the catalogue often looks a little like something that is. A cause is named only if it
    takes away half of the residual in every channel that misfits, or all of one that misfits much
    without adding to another.
    """
    misfitting = [n for n in first.sums if first.ratio(n) > levels.misfit]
    left = [last.ratio(n) / first.ratio(n) for n in misfitting]
    is_explained = any(
        first.ratio(n) > levels.large_misfit and last.ratio(n) < levels.misfit for n in misfitting
    )
    return bool(left) and (max(left) < levels.share_left or (is_explained and max(left) <= 1.0))
