"""The offline answer: the run to play, or the proof that none helps and the measurements to make instead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.bound import Apart, Bound, bound, measurements_apart
from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.proposal import DesignRequest, Proposal
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.shape_rater import noise_by_channel
from rsea_ros.identification.solver import Map, serial
from rsea_ros.progress import Progress

LONGEST_OF_ALL = 60.0
"""s of a run in whose length a pair must be hopeless to be called so."""


@dataclass(frozen=True)
class Proof:
    """A pair that no run separates: the larger bound of both directions, and separate measurements.

    covers_all: every effect of both is linear, so that the bound by sines holds for any run.
    """

    bound: Bound
    apart: tuple[Apart, ...]
    covers_all: bool

    @property
    def pair(self) -> tuple[str, str]:
        """The two causes."""
        return self.bound.true, self.bound.rival


@dataclass(frozen=True)
class Advice:
    """proposal: the run, None where no run decides anything. proofs: of the pairs that none separates.

    excluded: causes that the records contradict, with their probability.
    """

    hypotheses: tuple[Hypothesis, ...]
    asked: DesignRequest
    proposal: Proposal | None
    proofs: tuple[Proof, ...]
    excluded: Mapping[str, float] = field(default_factory=dict)


_WORTH = 0.02
"""Share of what is undecided that a run must decide to be worth playing."""


def advise(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float] | None = None,
    run: Map = serial,
    tell: Progress | None = None,
) -> Advice:
    """Return the run that separates hypotheses, and for pairs that no run separates the proof.

    measured: noise by channel. Raises ParameterError as propose does.
    """
    proposal = propose(hypotheses, asked, measured, run, tell)
    proofs = proofs_of(hypotheses, proposal.hopeless, asked, measured or {}, run)
    is_worth = len(hypotheses) == 1 or proposal.resolved > _WORTH
    return Advice(tuple(hypotheses), asked, proposal if is_worth else None, proofs)


def proofs_of(
    hypotheses: Sequence[Hypothesis],
    pairs: Sequence[tuple[str, str]],
    asked: DesignRequest,
    measured: Mapping[str, float],
    run: Map = serial,
) -> tuple[Proof, ...]:
    """Return the proofs for pairs that no run seems to separate; without those where one yet may."""
    named, noise = {h.name: h for h in hypotheses}, noise_by_channel(hypotheses, measured)
    proofs = [_prove(named[a], named[b], asked, noise, run) for a, b in pairs]
    return tuple(p for p in proofs if p is not None)


def _prove(
    a: Hypothesis, b: Hypothesis, asked: DesignRequest, noise: Mapping[str, float], run: Map
) -> Proof | None:
    """Return the proof that no run separates two, None where the bound leaves room for one."""
    both = [
        (i, j, bound(i, j, asked.limits, LONGEST_OF_ALL, noise, asked.rate, run)) for i, j in ((a, b), (b, a))
    ]
    true, rival, larger = max(both, key=lambda item: item[2].most)
    if not larger.is_hopeless:
        return None
    effects = [effect_named(e.name) for h in (a, b) for e in h.problem.rig.effects]
    is_linear = all(e.claims.amplitude_exponent == 1.0 for e in effects)
    return Proof(larger, tuple(measurements_apart(larger, true, rival)), is_linear)
