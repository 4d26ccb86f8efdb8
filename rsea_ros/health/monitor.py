"""The health of one joint from its topics: looks, their evidence, and its sensors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rsea_ros.errors import RigError
from rsea_ros.health.bank import Bank
from rsea_ros.health.changes import CandidateCauses, Changes
from rsea_ros.health.health_finding import HealthFinding, sensor_findings
from rsea_ros.health.hypotheses import FACTOR, GAINS, ChangeHypothesis, hypotheses_of, nuisances_of
from rsea_ros.health.look import FEWEST, Cutter, Look
from rsea_ros.health.recursive_estimates import ChangeEstimate
from rsea_ros.health.scatter import scatter_of
from rsea_ros.health.sensors import Sensors
from rsea_ros.health.settings import WatchSettings
from rsea_ros.health.tuning import tune
from rsea_ros.model.observer.log import STATE
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray, IntArray

JUMP = 1.0
"""s. Stamps that jump so far, either way, are of another run or of a clock that was set: looks begin anew."""
USUAL = 1e-3
"""s between measurements with which a look has too few."""
STILL = 30.0
"""Standard deviations of the position within which a look has too little motion."""


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
        Bank(rig, noise, hypotheses_of(rig, USUAL), self._settings.hold)
        self._least = STILL * noise.position if math.isfinite(noise.position) else 0.0
        self.sensors = Sensors(rig)
        self.looks = self.still = self.jumps = self.late = 0
        self.begin()

    def begin(self) -> None:
        """Restart the learning of the joint."""
        self._cutter = Cutter(self._settings.every)
        self._first: list[Look] = []
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
        closer = self.changes is None or self.changes.suspects
        for look in self._cutter.take(t, kind, values, closer=closer):
            self._weigh(look)

    @property
    def learning(self) -> bool:
        """Whether it does not know yet how the innovations scatter when all is right."""
        return self.changes is None

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
        else:
            self._learn(look)

    def _learn(self, look: Look) -> None:
        """Collect the first looks; then begin with their values and scatter."""
        self._first.append(look)
        if len(self._first) < self._settings.learn:
            return
        t = look.t[look.kind == STATE]
        period = float(np.median(np.diff(t))) if len(t) > FEWEST else USUAL
        models = hypotheses_of(self._rig, period)
        single = (*(h for h in models if h.name not in (FACTOR, *GAINS)), *nuisances_of(self._rig))
        rig, now = tune(self._rig, self._noise, single, self._first, self._settings.hold)
        known = {h.name: h for h in now}
        hypotheses = tuple(
            replace(h, value=known[h.name].value, common=known[h.name].common) if h.name in known else h
            for h in models
        )
        self._start(rig, hypotheses, {h.name: h.value for h in models})

    def _start(self, rig: Rig, hypotheses: tuple[ChangeHypothesis, ...], models: dict[str, float]) -> None:
        """Watch for changes from a rig, and from the first looks on."""
        bank = Bank(rig, self._noise, hypotheses, self._settings.hold)
        first, self._first = [(look, bank.evidence(look)) for look in self._first], []
        scatter = scatter_of([evidence for _, evidence in first])
        self.changes = Changes(rig, self._noise, hypotheses, models, scatter, self._settings)
        for each in first:
            self.changes.take(*each)
