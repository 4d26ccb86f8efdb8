"""The loop: weigh, propose, play, weigh all runs together, until the cause is known or no run can show it.

The loop does not know how a run is played: `play` gets a proposal and returns its record, None where a person
refuses. It raises DeviceError for a run that broke off, which is discarded, and the loop ends.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from rsea_ros.errors import DeviceError, IdentificationError, ParameterError
from rsea_ros.experiment.advice import Proof, proofs_of
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis, may_contain
from rsea_ros.experiment.joint_weighing import RunWeighing, weigh
from rsea_ros.experiment.proposal import DesignRequest, Proposal
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import FEWEST, largest_share
from rsea_ros.experiment.separation import ShapeRater, noise_by_channel, shapes_for, trial_of
from rsea_ros.identification.solver import Map, serial
from rsea_ros.model.rig import Rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

_FURTHEST = 6
"""Doublings of the torque limit up to which one is sought."""


def torque_that_shows(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float],
    run: Map = serial,
) -> float | None:
    """Return about the least torque limit (N m) at which a test shows the causes after the first.

    The test is the longest run, and the other limits stay as they are. None where even 2^_FURTHEST times the
    limit is not enough, as where another limit holds the torque back. measured: noise by channel.
    """
    apart = np.eye(len(hypotheses), dtype=bool)
    for k in range(1, _FURTHEST + 1):
        torque = 2.0**k * asked.limits.torque
        wider = replace(asked, limits=replace(asked.limits, torque=torque))
        rater = ShapeRater(hypotheses, wider, noise_by_channel(hypotheses, measured), run)
        if any(trial_of(rater, s, asked.longest, apart).share >= asked.test for s in shapes_for(asked)):
            return torque
    return None


@dataclass(frozen=True)
class SharedName:
    """A cause and those that contain it, which no run within the limits would rather show than not.

    names: the likeliest first. torque: N m, about the least limit with which a run would, None: none would.
    """

    names: tuple[str, ...]
    torque: float | None


def shared_name(
    causes: Sequence[Hypothesis], asked: DesignRequest, measured: Mapping[str, float], run: Map = serial
) -> SharedName | None:
    """Return the name that causes share, None where they do not all contain one of them.

    causes: the likeliest first. asked: of the test that would decide. measured: noise by channel.
    """
    contained = (c for c in causes if all(o is c or may_contain(o.name, c.name) for o in causes))
    simple = next(contained, None)
    if simple is None or len(causes) < 2:
        return None
    richer = [h.beside(simple.name) for h in causes if h is not simple]
    torque = torque_that_shows([simple, *richer], asked, measured, run)
    return SharedName(tuple(h.name for h in causes), torque)


End = Literal[
    "confirmed", "nothing_wrong", "unexplained", "undecidable", "spent", "declined", "broken", "failed"
]
"""confirmed: one cause. nothing_wrong: none is there. unexplained: no cause fits what the runs show.
undecidable: no run separates more, by a proof that covers all, or the longest did not; or the likeliest cause
shares its name with one that contains it. spent: the budget is. declined: a person said no. broken: a run
broke off. failed: the runs could not be weighed, or no run was possible within the limits.
"""
Play = Callable[[Proposal], Record | None]


@dataclass(frozen=True)
class Budget:
    """The budget of the loop. seconds: of excitation. energy: N^2 m^2 s, the integral of the squared torque,
    proportional to the heat in the winding. runs: at most.
    """

    seconds: float = 60.0
    energy: float = float("inf")
    runs: int = 8

    def __post_init__(self) -> None:
        for name in ("seconds", "energy", "runs"):
            if not getattr(self, name) > 0:
                raise ParameterError(f"budget {name} = {getattr(self, name):g}, expected > 0")


@dataclass(frozen=True)
class Rules:
    """When the loop ends. confirmed: probability of a cause. possible: probability from which it is still one
    that a run is designed for. floor: RMS over the noise above which the best cause leaves something else.
    by_data: S by which the data alone must prefer the best to every other of no more parameters, so that no
    name rests on its prior. shown: chance with which a run must decide for a possible cause of more
    parameters that fits as well, were it true, to be played before the simpler one is confirmed; where
    none within the limits has it, the two share the name. worth: share of what is undecided that the next
    run must be expected to decide; else the longest is designed. most: causes for which a run is designed.
    larger: than all runs before, by which a run that decides nothing by itself is worth playing, while it
    uses less than held_back of the limits at the likeliest values. likely: probability from which a cause is
    named among those that remain.
    """

    confirmed: float = 0.95
    possible: float = 0.005
    floor: float = 1.3
    worth: float = 0.02
    most: int = 7
    by_data: float = 6.0
    shown: float = 0.5
    larger: float = 1.15
    held_back: float = 0.8
    likely: float = 0.05


@dataclass(frozen=True)
class Round:
    """The knowledge before a run, and the run. proposal: None in the last round."""

    weighing: RunWeighing
    proposal: Proposal | None


@dataclass(frozen=True)
class CampaignOutcome:
    """How the loop ended. proofs: of pairs that no run separates. records: those that count, the first ones
    included. why: the failure, in words. shared: None where no cause was as good as known.
    """

    end: End
    rounds: tuple[Round, ...]
    records: tuple[Record, ...]
    proofs: tuple[Proof, ...] = ()
    why: str = ""
    shared: SharedName | None = None

    @property
    def weighing(self) -> RunWeighing:
        """The weighing by all runs together."""
        return self.rounds[-1].weighing

    @property
    def cause(self) -> str:
        """The most likely cause."""
        return self.weighing.best

    @property
    def seconds(self) -> float:
        """Excitation that was played, s."""
        return sum(r.proposal.duration for r in self.rounds if r.proposal is not None)


@dataclass
class _Session:
    """The state of a campaign."""

    records: list[Record]
    weighing: RunWeighing
    rounds: list[Round] = field(default_factory=list)

    @property
    def noise(self) -> Mapping[str, float]:
        """The noise by channel, as the first record shows it."""
        return self.weighing.cases[0].noise

    @property
    def played(self) -> list[Proposal]:
        """The runs so far."""
        return [r.proposal for r in self.rounds if r.proposal is not None]

    def conclude(
        self, end: End, proofs: tuple[Proof, ...] = (), why: str = "", shared: SharedName | None = None
    ) -> CampaignOutcome:
        rounds = (*self.rounds, Round(self.weighing, None))
        return CampaignOutcome(end, rounds, tuple(self.records), proofs, why, shared)


@dataclass
class Campaign:
    """A bench, its possible causes, the limits of runs. hear: called with each round at its start."""

    rig: Rig
    causes: Sequence[str]
    asked: DesignRequest
    play: Play
    budget: Budget = field(default_factory=Budget)
    rules: Rules = field(default_factory=Rules)
    run: Map = serial
    tell: Progress | None = None
    hear: Callable[[Round], None] = lambda _: None
    choose: Callable[..., Proposal] = propose
    """How the next run is chosen; a benchmark puts other policies here."""

    def go(self, records: Sequence[Record], first: RunWeighing | None = None) -> CampaignOutcome:
        """Run the loop from some records to its end. first: their weighing, if known.

        Raises IdentificationError where nothing can be fitted to them.
        """
        session = _Session(list(records), first or weigh(records, self.rig, self.causes, None, self.run))
        while (outcome := self._round(session)) is None:
            try:
                now = weigh(session.records, self.rig, self.causes, session.weighing, self.run)
            except IdentificationError as error:
                session.records.pop()
                return session.conclude("failed", why=str(error))
            session.weighing = now
        return outcome

    def possible(self, weighing: RunWeighing) -> list[Hypothesis]:
        """Return the causes for which a run is designed: those that may be, and those that fit as well."""
        near = weighing.near_by_data(self.rules.by_data)
        every = weighing.hypotheses()
        return [h for h in every if h.probability >= self.rules.possible or h.name in near][: self.rules.most]

    def _round(self, session: _Session) -> CampaignOutcome | None:
        """Design a run and have it played; return the outcome, None where the loop continues."""
        weighing = session.weighing
        end, spent = self.known_end(weighing), self._budget_end(session.played)
        richer = self._richer(session) if end == "confirmed" else []
        if end and not richer:
            return session.conclude(end)
        if spent:
            return session.conclude(spent)
        possible, is_test = richer or self.possible(weighing), bool(richer)
        try:
            proposal = self._design(session, possible, is_test)
        except ParameterError as error:
            return session.conclude("failed", why=str(error))
        if (outcome := self._hopeless_end(session, possible, proposal, is_test)) is not None:
            return outcome
        self.hear(Round(weighing, proposal))
        try:
            record = self.play(proposal)
        except DeviceError as error:
            return session.conclude("broken", why=str(error))
        if record is None:
            return session.conclude("declined")
        session.rounds.append(Round(weighing, proposal))
        session.records.append(record)
        return None

    def _design(self, session: _Session, possible: Sequence[Hypothesis], is_test: bool) -> Proposal:
        """Return the next run; the longest where a shorter one is not worth playing."""
        noise, played = session.noise, session.played
        asked = replace(self._asked(played), test=self.rules.shown if is_test else 0.0)
        proposal = self.choose(possible, asked, noise, self.run, self.tell)
        if is_test or self._is_worth(proposal, played) or proposal.duration >= asked.longest:
            return proposal
        return self.choose(possible, replace(asked, shortest=asked.longest), noise, self.run, self.tell)

    def _hopeless_end(
        self, session: _Session, possible: Sequence[Hypothesis], proposal: Proposal, is_test: bool
    ) -> CampaignOutcome | None:
        """Return the outcome where no run within the limits would help, None where this one may.

        It is a shared name if all causes that remain contain one.
        """
        may_help = self._may_show if is_test else self._is_worth
        if may_help(proposal, session.played):
            return None
        proofs = proofs_of(possible, proposal.hopeless, self.asked, session.noise, self.run)
        is_covered = any(p.covers_all and possible[0].name in p.pair for p in proofs)
        if not (is_test or is_covered or self._played_longest(session.played)):
            return None
        first, likely = possible[0].name, self.rules.likely
        remain = [h for h in possible if h.name == first or h.addition is not None or h.probability >= likely]
        asked = replace(self.asked, test=self.rules.shown)
        shared = shared_name(remain, asked, session.noise, self.run)
        return session.conclude("undecidable", proofs, shared=shared)

    def known_end(self, weighing: RunWeighing) -> End | None:
        """Return the outcome by present knowledge, None where the loop continues."""
        if weighing.probability[weighing.best] < self.rules.confirmed:
            return None
        if weighing.near_by_data(self.rules.by_data):
            return None
        if weighing.left > self.rules.floor:
            return "unexplained"
        return "nothing_wrong" if weighing.best == NOTHING else "confirmed"

    def _richer(self, session: _Session) -> list[Hypothesis]:
        """Return the best and the richer causes that fit as well, were not tested yet, and may be true.

        Empty without such. A run tests a cause that it would rather have shown than not, were it true.
        """
        weighing = session.weighing
        chances = (pair for p in session.played for pair in zip(p.names, p.chances, strict=True))
        seen = {name for name, chance in chances if chance >= self.rules.shown}
        names = set(weighing.near_by_data(self.rules.by_data, richer=True)) - seen
        rivals = [h for h in weighing.hypotheses(self.rules.possible) if h.name in names]
        return [weighing.hypotheses()[0], *rivals] if rivals else []

    def _may_show(self, proposal: Proposal, played: Sequence[Proposal]) -> bool:
        """Return whether a test would rather show a richer cause than not.

        One with a smaller chance is played too, unless a run of the longest length was.
        """
        chance = max(proposal.chances[1:])
        return chance >= self.rules.shown or (chance >= self.rules.worth and not self._played_longest(played))

    def _is_worth(self, proposal: Proposal, played: Sequence[Proposal]) -> bool:
        """Return whether a run may decide, or is the largest yet and lessens the doubt that holds it back."""
        before, now = max((p.peaks.at_level["torque"] for p in played), default=0.0), proposal.peaks
        is_larger = now.at_level["torque"] > self.rules.larger * before
        widens = is_larger and largest_share(now.expected, self.asked.limits) < self.rules.held_back
        return proposal.resolved >= self.rules.worth or widens

    def _played_longest(self, played: Sequence[Proposal]) -> bool:
        """Return whether a run of the longest length was played, to a tenth."""
        return max((p.duration for p in played), default=0.0) > 0.9 * self.asked.longest

    def _asked(self, played: Sequence[Proposal]) -> DesignRequest:
        """Return the request for the next run, within the budget.

        At least as long as all runs before it, which did not decide.
        """
        seconds = sum(p.duration for p in played)
        longest = min(self.asked.longest, self.budget.seconds - seconds)
        return replace(self.asked, shortest=min(max(self.asked.shortest, seconds), longest), longest=longest)

    def _budget_end(self, played: Sequence[Proposal]) -> End | None:
        seconds, energy = sum(p.duration for p in played), sum(p.energy for p in played)
        budget = self.budget
        next_run = max(self.asked.shortest, max(FEWEST.values()) / self.asked.rate)
        left = seconds + next_run <= budget.seconds and energy < budget.energy
        return None if left and len(played) < budget.runs else "spent"
