"""Changes of a joint against its model: alarms, the single cause of each, and the updated model.

Each hypothesis is fitted by Gauss-Newton with the observer itself, so play or a long delay, which no slope at
zero describes, are compared by their real effect. The cost of an innovation w is that of Student's t with
four degrees of freedom, 2.5 log(1 + w^2 / 4): outliers do not decide. The gain is the drop of its sum, over
the ratio of the best cause's cost to that of white innovations. Each hypothesis is fitted to the clearest
look first, the one with the greatest cost, and only those that explain it best are fitted to all looks.
Source: Lange, Little, Taylor, Journal of the American Statistical Association 84, 1989 (t instead of Gauss).

A sure cause becomes part of the model, so that a second change is compared with the present joint.
An unsure one is reported with its probability and fitted again with more looks: play on one
flank is a shifted zero until the torque changes its sign.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.health import hypotheses as hypo
from rsea_ros.health.health_finding import UNEXPLAINED, HealthFinding, WatchSettings
from rsea_ros.health.recursive_estimates import Cusum, Estimates, Scatter, threshold
from rsea_ros.model.observer.assemble import Noise
from rsea_ros.model.observer.log import BatchObserver
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95

FREEDOM = 4.0
WHITE = 0.48438
"""Mean cost of an innovation of variance 1: 2.5 E log(1 + z^2 / 4), z normal."""
ROUNDS, SHORTEST = 8, 0.02
"""Steps of Gauss-Newton; a step so small beside its own sigma, or beside `least`, is the last."""
HOPELESS, TRIES = 200.0, 2
"""Cost by which a fit may be worse than the best so far after so many steps, and still go on."""
FINALISTS = 4
"""Causes that are fitted to all looks."""
STARTS = (-3.0, 3.0, 12.0)
"""Changes from which a fit may begin, in `least`, beside that of the sensitivities."""


@dataclass(frozen=True)
class ChangeCause:
    """A fitted cause. change, ci95: in the parameter's unit. probability: among the causes that were fitted.

    explained: part of the excess of the innovations that it explains. cost: of the fit (see Fitter).
    """

    hypothesis: hypo.ChangeHypothesis
    change: float
    ci95: tuple[float, float]
    probability: float
    explained: float
    cost: float


_Point = tuple[float, FloatArray, float]
"""A change, its innovations and their cost."""


@dataclass(frozen=True)
class _Fit:
    hypothesis: hypo.ChangeHypothesis
    change: float
    cost: float
    sigma: float


@dataclass(frozen=True)
class Fitter:
    """Fits over some looks. scale: standard deviation of the innovations by channel when all is right."""

    rig: Rig
    noise: Noise
    hold: float
    looks: Sequence[hypo.Look]
    scale: FloatArray

    def causes(self, hypotheses: Sequence[hypo.ChangeHypothesis], starts: FloatArray) -> list[ChangeCause]:
        """Return the FINALISTS causes, the most probable first. starts: changes to begin with, (p,)."""
        before = self._innovations(self.rig)
        usual = WHITE * float(np.isfinite(before).sum())
        excess = float(cost(before) - usual)
        finalists = self._finalists(hypotheses, starts)
        fits = self._fits((f.hypothesis, self._at(f.hypothesis, f.change)) for f in finalists)
        phi = max(1.0, min(f.cost for f in fits) / usual)
        gains = np.array([(cost(before) - f.cost) / phi for f in fits])
        weights = np.exp(np.clip(gains - gains.max(), -700.0, 0.0))
        shares = (weights / weights.sum()).tolist()
        explained = [(excess + usual - f.cost) / max(excess, 1.0) for f in fits]
        half = [Z95 * f.sigma * math.sqrt(phi) for f in fits]
        candidates = [
            ChangeCause(f.hypothesis, f.change, (f.change - h, f.change + h), share, part, f.cost)
            for f, h, share, part in zip(fits, half, shares, explained, strict=True)
        ]
        return sorted(candidates, key=lambda cause: -cause.probability)

    def now(self) -> float:
        """Return the cost of the unchanged rig on the looks; zero without any."""
        return cost(self._innovations(self.rig)) if self.looks else 0.0

    def _finalists(self, hypotheses: Sequence[hypo.ChangeHypothesis], starts: FloatArray) -> list[_Fit]:
        """Return the fits to the clearest look that explain it best, the best first."""
        clearest = max((replace(self, looks=[look]) for look in self.looks), key=Fitter.now)
        begun = [(h, clearest._start(h, float(start))) for h, start in zip(hypotheses, starts, strict=True)]
        fits = clearest._fits(sorted(begun, key=lambda one: one[1][2]))
        return sorted(fits, key=lambda fit: fit.cost)[:FINALISTS]

    def _fits(self, begun: Iterable[tuple[hypo.ChangeHypothesis, _Point]]) -> list[_Fit]:
        """Return the fits of hypotheses from the points given; a hopeless one ends early."""
        fits: list[_Fit] = []
        for hypothesis, first in begun:
            limit = min((f.cost for f in fits), default=math.inf) + HOPELESS
            fits.append(self._fit(hypothesis, first, limit))
        return fits

    def _start(self, hypothesis: hypo.ChangeHypothesis, start: float) -> _Point:
        """Return the best of some changes to begin with."""
        starts = (start, *(k * hypothesis.least for k in STARTS))
        tried = [self._at(hypothesis, change) for change in {hypothesis.within(s) for s in starts}]
        return min(tried, key=lambda one: one[2])

    def _fit(self, hypothesis: hypo.ChangeHypothesis, first: _Point, limit: float) -> _Fit:
        """Return the best fit of one hypothesis: Gauss-Newton with the weights of the cost."""
        change, w, size = first
        step, sigma = max(0.1 * hypothesis.least, hypothesis.grain), math.inf
        for count in range(ROUNDS):
            if count == TRIES and size > limit:
                break
            ahead = change + step if hypothesis.within(change + step) == change + step else change - step
            d = (self._at(hypothesis, ahead)[1] - w) / (ahead - change)
            weight = (FREEDOM + 1.0) / (FREEDOM + w * w)
            information = float(np.nansum(weight * d * d))
            if not information > 0.0:
                break
            sigma, last = 1.0 / math.sqrt(information), change
            move = -float(np.nansum(weight * d * w)) / information
            for share in (1.0, 0.5, 0.2, 0.05):
                new = self._at(hypothesis, hypothesis.within(change + share * move))
                if new[2] < size:
                    change, w, size = new
                    break
            if abs(change - last) < SHORTEST * max(sigma, SHORTEST * hypothesis.least):
                break
        return _Fit(hypothesis, change, size, max(sigma, 0.5 * hypothesis.grain / Z95))

    def _at(self, hypothesis: hypo.ChangeHypothesis, change: float) -> _Point:
        """Return a change, its innovations and their cost."""
        w = self._innovations(hypothesis.change(self.rig, change))
        return change, w, cost(w)

    def _innovations(self, rig: Rig) -> FloatArray:
        observer = BatchObserver(rig, self.noise, hold=self.hold)
        by_look = (zip(hypo.whiten(observer, look), self.scale, strict=True) for look in self.looks)
        return np.concatenate([w / s for look in by_look for w, s in look])


def cost(w: FloatArray) -> float:
    """Return the cost of innovations; those that are missing cost nothing."""
    return 0.5 * (FREEDOM + 1.0) * float(np.nansum(np.log1p(w * w / FREEDOM)))


SURE = 0.95
"""Probability from which a cause is taken over into the model."""
EXPLAINED = 0.5
"""Part of the excess that a cause must explain to be named."""
SIMPLER = 5.0
"""Cost by which one cause in place of the last may be worse than that and another one beside it."""
LOUD, LOUDER = 2.0, 5.0
"""Standard deviations of a look's loudness: up to the first it is usual, beyond the second it is a change."""
PATIENT = 6
"""Looks that a fit has waited for, from which a change that no cause explains is said to be unexplained."""
REMEMBERED = 64


@dataclass(frozen=True)
class _Base:
    """The model that a joint is compared with, and its date (s)."""

    rig: Rig
    hypotheses: tuple[hypo.ChangeHypothesis, ...]
    since: float = -math.inf
    last: str = ""


@dataclass(frozen=True)
class CandidateCauses:
    """Causes beside the present model, and in place of the last adopted one.

    The second are also fitted to the looks right after its adoption; first is the model's cost on these.
    """

    beside: Sequence[ChangeCause]
    instead: Sequence[ChangeCause]
    first: float


Job = Callable[[], CandidateCauses]


class Changes:
    """Pass looks to `take`; when there is a `job`, run it and pass its result to `conclude`."""

    def __init__(
        self, rig: Rig, noise: Noise, hypotheses: Sequence[hypo.ChangeHypothesis],
        models: Mapping[str, float], scatter: Scatter, settings: WatchSettings,
    ) -> None:  # fmt: skip
        """models: values of the last model by name, against which sizes are said."""
        self._noise, self._scatter, self._settings = noise, scatter, settings
        self._models = dict(models)
        self._looks: deque[hypo.Look] = deque(maxlen=REMEMBERED)
        self._before: _Base | None = None
        self.findings: dict[str, HealthFinding] = {}
        self.job: Job | None = None
        self._begin(_Base(rig, tuple(hypotheses)))

    def _begin(self, base: _Base) -> None:
        """Begin to look for changes from a base."""
        self._base = base
        self.bank = hypo.Bank(base.rig, self._noise, base.hypotheses, self._settings.hold)
        inner, outer = (np.array([getattr(h, n) for h in base.hypotheses]) for n in ("inner", "outer"))
        loud = np.full(len(hypo.CHANNELS), 1.0)
        self._cusum = Cusum(np.append(inner, LOUD * loud), np.append(outer, LOUDER * loud), 0.0)
        self.watch(self._settings)
        self.estimates = Estimates(base.hypotheses)
        self._wait = self._patience = 0

    def watch(self, settings: WatchSettings) -> None:
        """Set the threshold of the sums, which go on."""
        self._settings, count = settings, 2 * len(self._base.hypotheses) + len(hypo.CHANNELS)
        self._cusum.h = threshold(settings.rate, count, settings.every)

    @property
    def suspects(self) -> bool:
        """Whether more should be looked at now: not for long where no cause is sure."""
        return self._cusum.suspects and self._patience <= PATIENT

    def take(self, look: hypo.Look, evidence: hypo.LookEvidence) -> None:
        """Process a look with motion."""
        self._looks.append(look)
        score, information = evidence.scale_sums(self._scatter.scale)
        self.estimates.take(score, information, self._scatter.phi)
        loud = np.maximum(0.0, self._scatter.excess(evidence))
        one = np.ones(len(loud))
        alarm = self._cusum.take(
            np.append(score, loud), np.append(np.diag(information), one), np.append(self._scatter.phi, one)
        )
        self._wait = max(0, self._wait - 1)
        if alarm and self.job is None and not self._wait:
            self._ask(score / np.maximum(np.diag(information), 1e-300))

    def _ask(self, starts: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
        """Request a fit of each cause: to the newest looks, and to the first ones of this change."""
        since = min(max(self._cusum.since, 1), len(self._looks))
        recent = list(self._looks)[-since:]
        self._began = recent[0].t[0] + hypo.FILTER_SETTLING
        looks = _spread(recent, self._settings.fitted)
        first = [look for look in self._looks if self._base.since <= look.t[0] < recent[0].t[0]][:2]
        base, before = self._base, self._before

        def fit() -> CandidateCauses:
            beside = self._fitter(base, looks).causes(base.hypotheses, starts)
            if before is None:
                return CandidateCauses(beside, (), 0.0)
            instead = self._fitter(before, (*first, *looks)).causes(before.hypotheses, starts)
            return CandidateCauses(beside, instead, self._fitter(base, first).now())

        self.job = fit

    def _fitter(self, base: _Base, looks: Sequence[hypo.Look]) -> Fitter:
        return Fitter(base.rig, self._noise, self._settings.hold, looks, self._scatter.scale)

    def conclude(self, answer: CandidateCauses) -> HealthFinding | None:
        """Take the result of the job; return the finding that is new, if one is."""
        self.job = None
        both = answer.beside[0].cost + answer.first
        if self._before is not None and answer.instead and answer.instead[0].cost < both + SIMPLER:
            self.findings.pop(self._before.last, None)
            self._base, self._before = replace(self._before, since=self._base.since), None
            return self._weigh(answer.instead)
        return self._weigh(answer.beside)

    def _weigh(self, causes: Sequence[ChangeCause]) -> HealthFinding | None:
        """Name the best cause, take it over where it is sure, wait for more where it is not."""
        best, code = causes[0], causes[0].hypothesis.code
        confidence = sum(c.probability for c in causes if c.hypothesis.code == code)
        if best.explained < EXPLAINED:
            left = 1.0 - max(best.explained, 0.0)
            finding = HealthFinding(UNEXPLAINED, UNEXPLAINED, self._began, left)
            return self._later(finding if self._patience >= PATIENT else None)
        self.findings.pop(UNEXPLAINED, None)
        finding = self._finding(best, confidence)
        if confidence < SURE:
            return self._later(finding if _is_change(best.hypothesis, finding.size) else None)
        return self._adopt(best, finding)

    def _finding(self, cause: ChangeCause, confidence: float) -> HealthFinding:
        h, half = cause.hypothesis, 0.5 * (cause.ci95[1] - cause.ci95[0])
        size = h.value + cause.change - self._models[h.name]
        since = self.findings[h.name].since if h.name in self.findings else self._began
        return HealthFinding(h.code, h.name, since, confidence, h.unit, size, (size - half, size + half))

    def _later(self, finding: HealthFinding | None) -> HealthFinding | None:
        """Report an unsure cause, and fit again after twice as many looks as before."""
        self._patience = min(2 * self._patience + 2, REMEMBERED)
        self._wait = self._patience
        if finding is None:
            return None
        known = finding.name in self.findings
        self.findings = {n: f for n, f in self.findings.items() if f.confidence >= SURE}
        self.findings[finding.name] = finding
        return None if known else finding

    def _adopt(self, cause: ChangeCause, finding: HealthFinding) -> HealthFinding | None:
        """Adopt a cause into the model; a change within the model's doubt does not count."""
        h = cause.hypothesis
        adopted = replace(h, value=h.value + cause.change)
        hypotheses = tuple(adopted if other.name == h.name else other for other in self._base.hypotheses)
        self.findings = {n: f for n, f in self.findings.items() if f.confidence >= SURE}
        changed = _is_change(h, finding.size)
        self._before = replace(self._base, last=h.name) if changed else None
        began = self._began - hypo.FILTER_SETTLING
        self._begin(_Base(h.change(self._base.rig, cause.change), hypotheses, began))
        if not changed:
            self.findings.pop(h.name, None)
            return None
        self.findings[h.name] = finding
        return finding


def _is_change(hypothesis: hypo.ChangeHypothesis, size: float) -> bool:
    """Return whether a parameter that is so far off the last model is beyond that model's doubt."""
    return abs(size) > hypothesis.inner + 0.5 * hypothesis.least


def _spread(looks: Sequence[hypo.Look], count: int) -> list[hypo.Look]:
    """Return some of the looks, evenly spread, the newest among them."""
    at = np.unique(np.linspace(0, len(looks) - 1, min(count, len(looks))).round().astype(int))
    return [looks[k] for k in at]
