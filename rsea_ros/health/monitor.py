"""The health of one joint from what its topics bring: looks, evidence, alarms, causes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.health.bank import CHANNELS, Bank, Evidence
from rsea_ros.health.cusum import Cusum, threshold
from rsea_ros.health.estimates import Estimate, Estimates
from rsea_ros.health.finding import Finding, sensor_findings
from rsea_ros.health.hypotheses import Hypothesis, hypotheses_of
from rsea_ros.health.look import FEWEST, SETTLE, Cutter, Look
from rsea_ros.health.sensors import Sensors
from rsea_ros.health.single_cause import Cause, Fitter
from rsea_ros.model.observer.log import STATE
from rsea_ros.model.observer.noise import Noise
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray, IntArray

JUMP = 1.0
"""s. Stamps that jump so far, either way, are of another run or of a clock that was set: looks begin anew."""
STILL = 30.0
"""Standard deviations of the position within which a look moved nothing that could tell of the joint."""
EXPLAINED = 0.5
"""Part of the excess that a cause must explain to be named."""
SCALES = 0.3, 3.0
"""Standard deviations that the innovations of a right model may have beside those that the rig promises."""
_NONE = "RSEA_UNEXPLAINED"


@dataclass(frozen=True)
class Settings:
    """rate: false alarms an hour. every: s between looks. learn: looks that show how the innovations scatter.

    fitted: looks that a cause is fitted to. hold: s, how long a command stays in force.
    """

    rate: float = 1e-3
    every: float = 3.0
    learn: int = 20
    fitted: int = 4
    hold: float = 0.05


Job = Callable[[], Sequence[Cause]]


class Monitor:
    """Take in events with `take`; when `job` is not None, run it (a second or two of work), then `conclude`."""

    def __init__(self, rig: Rig, noise: Noise, settings: Settings | None = None) -> None:
        self._rig, self._noise, self.settings = rig, noise, settings or Settings()
        self.sensors = Sensors(rig)
        self._cutter = Cutter(self.settings.every)
        self._hypotheses: tuple[Hypothesis, ...] = ()
        self._models: dict[str, float] = {}
        self._learned: list[Evidence] = []
        self._scale, self._phi = np.ones(len(CHANNELS)), np.ones(0)
        self._looks: deque[Look] = deque(maxlen=64)
        self._found: dict[str, Finding] = {}
        self.job: Job | None = None
        self.looks = self.still = self.jumps = self.late = 0
        self.now = -math.inf

    def take(self, t: FloatArray, kind: IntArray, values: FloatArray) -> None:
        """Take in events (see Look), sorted by stamp, s; those before what was taken are counted and left out."""
        if len(t) and abs(t[0] - self.now) > JUMP and math.isfinite(self.now):
            self.jumps += 1
            self._cutter.clear()
            self.now = -math.inf
        new = t >= self.now
        self.late += int(len(t) - new.sum())
        t, kind, values = t[new], kind[new], values[new]
        if not len(t):
            return
        self.now = float(t[-1])
        self.sensors.take(t, kind, values)
        for look in self._cutter.take(t, kind, values, closer=self.learning or self._cusum.suspects):
            self._judge(look)

    @property
    def learning(self) -> bool:
        """Whether it does not know yet how the innovations scatter when all is right."""
        return not len(self._phi)

    def findings(self) -> list[Finding]:
        """Return what is wrong."""
        return [*self._found.values(), *sensor_findings(self.sensors, self.jumps, self.late)]

    def estimates(self) -> list[Estimate]:
        """Return all parameters; none before the first look."""
        return self._estimates.estimates() if self._hypotheses else []

    def _judge(self, look: Look) -> None:
        if not self._hypotheses:
            self._prepare(look)
        self.looks += 1
        if self.sensors.frozen or look.travel() < STILL * self._noise.position:
            self.still += 1
            self._estimates.hold()
            return
        self._looks.append(look)
        evidence = self._bank.judge(look)
        if self.learning:
            self._learned.append(evidence)
            if len(self._learned) < self.settings.learn:
                return
            self._learn()
            for each in self._learned:
                self._weigh(each)
            self._learned = []
        else:
            self._weigh(evidence)

    def _prepare(self, look: Look) -> None:
        """Make the observers, once the period of the measurements is known."""
        t = look.t[look.kind == STATE]
        period = float(np.median(np.diff(t))) if len(t) > FEWEST else 1e-3
        self._hypotheses = hypotheses_of(self._rig, period)
        self._models = {h.name: h.value for h in self._hypotheses}
        self._base()

    def _base(self) -> None:
        """Begin to look for changes from the rig as it is known now."""
        self._bank = Bank(self._rig, self._noise, self._hypotheses, self.settings.hold)
        h = threshold(self.settings.rate, 2 * len(self._hypotheses), self.settings.every)
        self._cusum = Cusum(self._hypotheses, h)
        self._estimates = Estimates(self._hypotheses)

    def _learn(self) -> None:
        """Take the scatter of the innovations and of the scores from the first looks."""
        squares, counts = (sum(getattr(e, n) for e in self._learned) for n in ("squares", "counts"))
        self._scale = np.clip(np.sqrt(squares / np.maximum(counts, 1.0)), *SCALES)
        scores, informations = zip(*(e.scaled(self._scale) for e in self._learned), strict=True)
        c, a = np.array(scores), np.array([np.diag(i) for i in informations])
        mean = c.sum(axis=0) / np.maximum(a.sum(axis=0), 1e-300)
        scatter = (c - a * mean) ** 2 / np.maximum(a, 1e-300)
        self._phi = np.maximum(1.0, scatter.sum(axis=0) / (len(c) - 1))

    def _weigh(self, evidence: Evidence) -> None:
        score, information = evidence.scaled(self._scale)
        self._estimates.take(score, information, self._phi)
        if self._cusum.take(score, np.diag(information), self._phi) and self.job is None:
            self._ask(score, information)

    def _ask(self, score: FloatArray, information: FloatArray) -> None:
        """Ask for a fit of each cause to the looks since the sums began to grow."""
        since = min(self._cusum.since, len(self._looks))
        looks = list(self._looks)[-min(since, self.settings.fitted) :]
        self._began = list(self._looks)[-since].t[0] + SETTLE
        starts = score / np.maximum(np.diag(information), 1e-300)
        fitter = Fitter(self._rig, self._noise, self.settings.hold, looks, self._scale)
        hypotheses = self._hypotheses
        self.job = lambda: fitter.causes(hypotheses, starts)

    def conclude(self, causes: Sequence[Cause]) -> Finding | None:
        """Take the result of the job; return the finding that is new or has changed, if one is."""
        self.job = None
        best = causes[0]
        if best.explained < EXPLAINED:
            self._cusum.clear()
            since = self._found[_NONE].since if _NONE in self._found else self._began
            self._found[_NONE] = Finding(_NONE, "", "", math.nan, (math.nan, math.nan), since, 1.0 - best.explained)
            return self._found[_NONE]
        return self._adopt(best, sum(c.probability for c in causes if c.hypothesis.code == best.hypothesis.code))

    def _adopt(self, cause: Cause, confidence: float) -> Finding | None:
        """Take a cause over into the rig, so that what comes is compared with the joint as it is now."""
        h = cause.hypothesis
        self._rig = h.changed(self._rig, cause.change)
        half = 0.5 * (cause.ci95[1] - cause.ci95[0])
        adopted = replace(h, value=h.value + cause.change)
        self._hypotheses = tuple(adopted if other.name == h.name else other for other in self._hypotheses)
        self._base()
        size = adopted.value - self._models[h.name]
        if abs(size) <= h.outer - 0.5 * h.least:
            self._found.pop(h.name, None)
            return None
        since = self._found[h.name].since if h.name in self._found else self._began
        self._found[h.name] = Finding(
            h.code, h.name, h.unit, size, (size - half, size + half), since, confidence
        )
        return self._found[h.name]
