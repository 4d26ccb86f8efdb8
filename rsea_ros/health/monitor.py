"""The health of one joint from its topics: what is usual is learnt first, then looks and sensors are watched.

The computation examines one look at a time, so that learning takes as little of a core as watching does.

d = argmin d' (A + F_0) d / 2 - c' d,   F_0 = diag(1 / doubt^2),   |d| <= Z95 doubt

for all parameters together. A deviation beyond the doubt stays a change and alarms.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from rsea_ros.errors import RigError
from rsea_ros.health import hypotheses as hypo
from rsea_ros.health.changes import CandidateCauses, Changes
from rsea_ros.health.health_finding import HealthFinding, Sensors, WatchSettings, sensor_findings
from rsea_ros.health.recursive_estimates import ChangeEstimate, scatter_of
from rsea_ros.model.observer.assemble import Noise
from rsea_ros.model.observer.log import STATE
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, IntArray
from rsea_ros.records.statistics import Z95

_CERTAIN = 1e-6
"""Doubt of what has none, in its smallest change: such a parameter does not move."""


ROUNDS = 2
"""Solutions of the linear problem, each about the one before."""


def tune(
    rig: Rig, noise: Noise, hypotheses: Sequence[hypo.ChangeHypothesis], looks: Sequence[hypo.Look],
    hold: float,
) -> Generator[None, None, tuple[Rig, tuple[hypo.ChangeHypothesis, ...]]]:
    """Return rig and hypotheses with the values that the looks have, within the doubts; yield as examine."""
    total, now, first = np.zeros(len(hypotheses)), tuple(hypotheses), rig
    for _ in range(ROUNDS):
        evidence = yield from examine(hypo.Bank(rig, noise, now, hold), looks)
        total, sigma = _change(evidence, hypotheses, total)
        changes = list(zip(hypotheses, total.tolist(), strict=True))
        now = tuple(
            replace(h, value=min(max(h.value + by, h.low), h.high), common=s)
            for (h, by), s in zip(changes, sigma.tolist(), strict=True)
        )
        rig = first
        for hypothesis, by in changes:
            rig = hypothesis.change(rig, by)
    return rig, now


def examine(bank: hypo.Bank, looks: Sequence[hypo.Look]) -> Generator[None, None, list[hypo.LookEvidence]]:
    """Return the evidence of the looks; yield after each."""
    evidence = []
    for look in looks:
        evidence.append(bank.evidence(look))
        yield
    return evidence


def _change(
    evidence: Sequence[hypo.LookEvidence], hypotheses: Sequence[hypo.ChangeHypothesis], before: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the change of each parameter in all and its sigma, (p,). before: as the looks were judged."""
    scatter = scatter_of(evidence)
    both = [e.scale_sums(scatter.scale) for e in evidence]
    score, information = np.sum([c for c, _ in both], axis=0), np.sum([a for _, a in both], axis=0)
    doubt = np.array([max(h.doubt, _CERTAIN * h.least) for h in hypotheses])
    information, score = information * np.outer(doubt, doubt), score * doubt
    root = np.linalg.cholesky(information + np.eye(len(doubt)))
    wanted = np.linalg.solve(root, score + information @ (before / doubt))
    sigma = doubt * np.sqrt(np.diag(np.linalg.inv(root @ root.T)))
    return doubt * lsq_linear(root.T, wanted, bounds=(-Z95, Z95)).x, sigma


USUAL = 1e-3
"""s between measurements with which a look has too few."""


def learn(
    rig: Rig, noise: Noise, looks: Sequence[hypo.Look], settings: WatchSettings
) -> Generator[None, None, Changes]:
    """Tune a rig to looks and return the changes since, these looks taken; yield after each examined look."""
    t = looks[-1].t[looks[-1].kind == STATE]
    period = float(np.median(np.diff(t))) if len(t) > hypo.FEWEST else USUAL
    models = hypo.hypotheses_of(rig, period)
    single = (*(h for h in models if h.name not in (hypo.FACTOR, *hypo.GAINS)), *hypo.nuisances_of(rig))
    tuned, now = yield from tune(rig, noise, single, looks, settings.hold)
    known = {h.name: h for h in now}
    hypotheses = tuple(
        replace(h, value=known[h.name].value, common=known[h.name].common) if h.name in known else h
        for h in models
    )
    evidence = yield from examine(hypo.Bank(tuned, noise, hypotheses, settings.hold), looks)
    last = {h.name: h.value for h in models}
    changes = Changes(tuned, noise, hypotheses, last, scatter_of(evidence), settings)
    for look, its in zip(looks, evidence, strict=True):
        changes.take(look, its)
    return changes


JUMP = 1.0
"""s. Stamps that jump so far, either way, are of another run or of a clock that was set: looks begin anew."""
STILL = 30.0
"""Standard deviations of the position within which a look has too little motion."""

_NOTHING = hypo.Look(np.zeros(1), np.zeros(1, dtype=np.int64), np.zeros((1, 2)), np.zeros(1, dtype=bool))
"""A look without measurements that count: with it the filter is compiled before the joint is watched."""


class Monitor:
    """Pass events to `take`; when there is a `job`, run it (seconds) and pass its result to `conclude`.

    looks, still: looks that were evaluated, and looks without motion. jumps: of the stamps. late: events left
    out.
    """

    def __init__(self, rig: Rig, noise: Noise, settings: WatchSettings | None = None) -> None:
        """Raises RigError for a rig that the observer cannot follow."""
        if rig.loop is not None:
            raise RigError(f"rig {rig.name}: a position loop commands it, expected torques as commands")
        self._rig, self._noise, self._settings = rig, noise, settings or WatchSettings()
        hypo.Bank(rig, noise, hypo.hypotheses_of(rig, USUAL), self._settings.hold).evidence(_NOTHING)
        self._least = STILL * noise.position if math.isfinite(noise.position) else 0.0
        self.sensors = Sensors(rig)
        self.looks = self.still = self.jumps = self.late = 0
        self.begin()

    def begin(self) -> None:
        """Restart the learning of the joint."""
        self._cutter = hypo.Cutter(self._settings.every)
        self._first: list[hypo.Look] = []
        self._learning = learn(self._rig, self._noise, self._first, self._settings)
        self._examined = -math.inf
        self.changes: Changes | None = None
        self.now = -math.inf

    def watch(self, settings: WatchSettings) -> None:
        """Watch with other thresholds from now on; `learn` counts when it begins to learn anew."""
        self._settings, self._cutter.every = settings, settings.every
        if self.changes is not None:
            self.changes.watch(settings)

    def take(self, t: FloatArray, kind: IntArray, values: FloatArray) -> None:
        """Process events (see Look), sorted by stamp; late ones are counted, not used."""
        if len(t) and math.isfinite(self.now) and abs(t[0] - self.now) > JUMP:
            self.jumps += 1
            self._cutter.clear()
            self.sensors.begin()
            self.now = -math.inf
        new = t >= self.now
        self.late += int(len(t) - new.sum())
        t, kind, values = t[new], kind[new], values[new]
        if not len(t):
            return
        self.now = float(t[-1])
        self.sensors.take(t, kind, values)
        closer = self._collecting or bool(self.changes and self.changes.suspects)
        for look in self._cutter.take(t, kind, values, closer=closer):
            self._weigh(look)
        if self.learning and not self._collecting:
            self._learn()

    @property
    def learning(self) -> bool:
        """Whether it does not know yet how the innovations scatter when all is right."""
        return self.changes is None

    @property
    def _collecting(self) -> bool:
        """Whether it needs more looks to learn that."""
        return len(self._first) < self._settings.learn

    @property
    def job(self) -> Callable[[], CandidateCauses] | None:
        """The computation that the next finding needs."""
        return None if self.changes is None else self.changes.job

    def conclude(self, answer: CandidateCauses) -> HealthFinding | None:
        """Take the result of the job; return the finding that is new, if one is."""
        assert self.changes is not None
        return self.changes.conclude(answer)

    def findings(self) -> list[HealthFinding]:
        """Return the present findings."""
        changed = [] if self.changes is None else list(self.changes.findings.values())
        return [*changed, *sensor_findings(self.sensors, self.jumps, self.late)]

    def estimates(self) -> list[ChangeEstimate]:
        """Return all parameters; none while it learns."""
        return [] if self.changes is None else self.changes.estimates.estimates()

    def _weigh(self, look: hypo.Look) -> None:
        self.looks += 1
        if self.sensors.frozen or look.travel() < self._least:
            self.still += 1
            if self.changes is not None:
                self.changes.estimates.hold()
        elif self.changes is not None:
            self.changes.take(look, self.changes.bank.evidence(look))
        elif self._collecting:
            self._first.append(look)

    def _learn(self) -> None:
        """Examine the next look, at most one every `every` seconds.

        After the last watch for changes from what was learned, and from the first looks on.
        """
        if 0.0 <= self.now - self._examined < self._settings.every:
            return
        self._examined = self.now
        try:
            next(self._learning)
        except StopIteration as end:
            self.changes = end.value
            end.value.watch(self._settings)
