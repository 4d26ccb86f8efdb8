"""The health of one joint from its topics: looks, their evidence, and its sensors."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rsea_ros.errors import RigError
from rsea_ros.health.changes import CandidateCauses, Changes
from rsea_ros.health.health_finding import HealthFinding, WatchSettings, sensor_findings
from rsea_ros.health.hypotheses import Bank, hypotheses_of
from rsea_ros.health.learning import USUAL, Learned, Learning
from rsea_ros.health.look import Cutter, Look
from rsea_ros.health.recursive_estimates import ChangeEstimate, scatter_of
from rsea_ros.health.sensors import Sensors
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, IntArray

JUMP = 1.0
"""s. Stamps that jump so far, either way, are of another run or of a clock that was set: looks begin anew."""
STILL = 30.0
"""Standard deviations of the position within which a look has too little motion."""

_NOTHING = Look(np.zeros(1), np.zeros(1, dtype=np.int64), np.zeros((1, 2)), np.zeros(1, dtype=bool))
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
        Bank(rig, noise, hypotheses_of(rig, USUAL), self._settings.hold).evidence(_NOTHING)
        self._least = STILL * noise.position if math.isfinite(noise.position) else 0.0
        self.sensors = Sensors(rig)
        self.looks = self.still = self.jumps = self.late = 0
        self.begin()

    def begin(self) -> None:
        """Restart the learning of the joint."""
        self._cutter = Cutter(self._settings.every)
        self._learning: Learning | None = Learning(self._rig, self._noise, self._settings)
        self.changes: Changes | None = None
        self.now = -math.inf

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
        closer = self._learning.collecting if self._learning else bool(self.changes and self.changes.suspects)
        for look in self._cutter.take(t, kind, values, closer=closer):
            self._weigh(look)
        if self._learning is not None:
            self._start(self._learning.advance(self.now))

    @property
    def learning(self) -> bool:
        """Whether it does not know yet how the innovations scatter when all is right."""
        return self._learning is not None

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

    def _weigh(self, look: Look) -> None:
        self.looks += 1
        if self.sensors.frozen or look.travel() < self._least:
            self.still += 1
            if self.changes is not None:
                self.changes.estimates.hold()
        elif self.changes is not None:
            self.changes.take(look, self.changes.bank.evidence(look))
        elif self._learning is not None:
            self._learning.take(look)

    def _start(self, learned: Learned | None) -> None:
        """Watch for changes from what was learned, if learning is over, and from the first looks on."""
        if learned is None:
            return
        self._learning = None
        self.changes = Changes(
            learned.rig, self._noise, learned.hypotheses, learned.models, scatter_of(learned.evidence),
            self._settings,
        )  # fmt: skip
        for look, evidence in zip(learned.looks, learned.evidence, strict=True):
            self.changes.take(look, evidence)
