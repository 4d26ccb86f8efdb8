"""The outcome: the verdict on weighed causes, those that are named, and those that may not be."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rsea_ros.diagnosis.criteria import is_at_floor, takes_most, verdict_of
from rsea_ros.diagnosis.evaluation import Evaluated, Examined
from rsea_ros.diagnosis.naming.cause_facts import cause_of, dropped_cause, is_known, size_of
from rsea_ros.diagnosis.naming.status import Named, name_causes
from rsea_ros.diagnosis.naming.weighing import Weighing
from rsea_ros.diagnosis.result import Cause, Rejected, Verdict
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.selection import Selection
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.errors import IdentificationError
from rsea_ros.records.record import MEASURED


@dataclass(frozen=True)
class Outcome:
    """The outcome of weighing the causes.

    channel: of verdict and gains. stages: models from the nominal one to the extended one.
    dropped: accepted effects that may not be named. named: by cause its status.
    """

    verdict: Verdict
    channel: str
    stages: Sequence[Evaluated]
    causes: tuple[Cause, ...]
    dropped: tuple[Rejected, ...]
    named: Mapping[str, Named]


def outcome_of(weighing: Weighing, examined: Examined, settings: DiagnosisSettings) -> Outcome:
    """Return the verdict on weighed causes, those that are named, and those that may not be."""
    selection, stages, levels = weighing.selection, weighing.stages, settings.floor
    channel = next((n for n in MEASURED if n in stages[0].test.sums), None)
    if channel is None:
        source = examined.records[0].source
        raise IdentificationError(f"{source}: no sample is left to test on, expected a longer record")
    naming = naming_of(weighing, settings)
    steps = itertools.pairwise(stages)
    dropped = tuple(dropped_cause(a, b, naming, channel) for a, b in steps if not is_named(b, naming))
    stages = without_unnamed_end(stages, naming)
    naming = with_sizes_known(naming, stages, settings)
    statuses = [naming[s.added].status if s.added in naming else None for s in stages[1:]]
    verdict = verdict_of([s.test for s in stages], statuses, levels, examined.faults)
    if verdict == "unexplained":
        channel, stages = main_channel(stages[0].test, channel, levels.reached), stages[:1]
    causes = tuple(
        with_rivals(cause_of(step, stages[-1], channel, naming[step[1].added], settings), selection)
        for step in itertools.pairwise(stages)
        if is_named(step[1], naming)
    )
    return Outcome(verdict, causes[0].channel if causes else channel, stages, causes, dropped, naming)


def with_rivals(cause: Cause, selection: Selection) -> Cause:
    """Return a cause with the names of the effects that do as well in its place."""
    return replace(cause, confusable_with=tuple(m.newest for m in selection.rivals_of(cause.name)))


def naming_of(weighing: Weighing, settings: DiagnosisSettings) -> dict[str, Named]:
    """Return the naming of each cause."""
    first, last = weighing.stages[0].test, weighing.stages[-1].test
    at_floor, most = is_at_floor(last, settings.floor), takes_most(first, last, settings)
    return {n.cause.evidence.name: n for n in name_causes(weighing.places, at_floor, most, settings)}


def with_sizes_known(
    naming: Mapping[str, Named], stages: Sequence[Evaluated], settings: DiagnosisSettings
) -> dict[str, Named]:
    """Return the naming with no cause confirmed whose size the last model leaves open."""
    rule = settings.sizes
    sized = {s.added: size_of(s.added, stages[-1], rule) for s in stages[1:] if is_named(s, naming)}
    unknown = {name for name, size in sized.items() if not is_known(size, rule)}
    return {
        name: replace(by, status="leading") if name in unknown and by.status == "confirmed" else by
        for name, by in naming.items()
    }


def is_named(stage: Evaluated, naming: Mapping[str, Named]) -> bool:
    """Return whether the cause that a stage adds may be named."""
    return stage.added in naming and naming[stage.added].status is not None


def without_unnamed_end(stages: Sequence[Evaluated], naming: Mapping[str, Named]) -> list[Evaluated]:
    """Return the stages without the last ones whose cause is not named: no other was fitted beside it."""
    kept = list(stages)
    while len(kept) > 1 and not is_named(kept[-1], naming):
        kept.pop()
    return kept


def main_channel(test: Score, channel: str, reached: float = DEFAULT.floor.reached) -> str:
    """Return the channel that shows an unexplained residual: `channel` if above noise, else the worst."""
    return channel if test.ratio(channel) > reached else test.worst
