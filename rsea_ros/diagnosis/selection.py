"""The selection: the accepted models, and every other effect that was tried, with the reason against it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rsea_ros.diagnosis.candidate import Candidate
from rsea_ros.diagnosis.result import Reason
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class Trial:
    """An effect tried beside a model. problem, theta: with it, at the end of its fit.

    is_full: fitted to all training blocks, not only to short pieces. rival: the effect that was preferred.
    """

    name: str
    beside: Candidate
    problem: Problem
    theta: FloatArray
    is_full: bool
    reason: Reason
    rival: str = ""


def trial_of(model: Candidate, name: str, beside: Candidate, reason: Reason, rival: str = "") -> Trial:
    """Return the trial of an effect that was fitted to all training blocks."""
    return Trial(name, beside, model.problem, model.solution.theta, True, reason, rival)


@dataclass(frozen=True)
class Selection:
    """The accepted models, from the nominal one on, and other trials.

    rivals: by accepted cause, the models that do as well with another effect in its place.
    """

    models: tuple[Candidate, ...]
    trials: tuple[Trial, ...] = ()
    rivals: Mapping[str, tuple[Candidate, ...]] = field(default_factory=dict)

    @property
    def cases(self) -> tuple[Case, ...]:
        """Every sample of the records, with the noise by the last model."""
        return self.last.cases

    @property
    def last(self) -> Candidate:
        """The model with all accepted causes."""
        return self.models[-1]

    def rivals_of(self, cause: str) -> tuple[Candidate, ...]:
        """Return the models that do as well with another in a cause's place, which is no cause beside it."""
        return tuple(m for m in self.rivals.get(cause, ()) if m.newest not in self.last.causes)
