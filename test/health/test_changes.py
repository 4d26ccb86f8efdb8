"""Fits of causes beside scipy's minima, and what is said of causes that are put in."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from rsea_ros.health import changes
from rsea_ros.health.changes import (
    FINALISTS,
    WHITE,
    CandidateCauses,
    ChangeCause,
    Changes,
    Fitter,
    _is_change,
    _spread,
    cost,
)
from rsea_ros.health.health_finding import UNEXPLAINED, WatchSettings

T4 = stats.t(4.0)


def test_the_cost_is_that_of_students_t_and_missing_innovations_cost_nothing():
    w = np.array([0.3, -2.0, 9.0])
    assert cost(w) == pytest.approx(float(np.sum(T4.logpdf(0.0) - T4.logpdf(w))))
    assert cost(np.array([0.3, -2.0, 9.0, np.nan])) == cost(w)
    white = integrate.quad(lambda z: (T4.logpdf(0.0) - T4.logpdf(z)) * stats.norm.pdf(z), -9.0, 9.0)[0]
    assert pytest.approx(white, rel=1e-5) == WHITE


@dataclass(frozen=True)
class Hypothesis:
    """A parameter of which innovations depend. low, high: of its change."""

    name: str
    least: float = 0.1
    grain: float = 0.0
    inner: float = 0.5
    outer: float = 1.0
    value: float = 10.0
    code: str = "RSEA_X"
    unit: str = "N m"
    low: float = -50.0
    high: float = 50.0

    def within(self, change):
        return min(max(change, self.low), self.high)

    def change(self, rig, by):
        return {**rig, self.name: rig.get(self.name, 0.0) + by}


RNG = np.random.default_rng(11)
COUNT = 400
NOISE = RNG.standard_normal((2, COUNT))
SHAPES = {name: RNG.standard_normal((2, COUNT)) for name in ("true", "alike", "other", "none", "fifth")}
SHAPES["alike"] = 0.9 * SHAPES["true"] + 0.1 * SHAPES["alike"]


class Bench(Fitter):
    """Innovations that `true` = 1.5 makes white; a look is 0 or 1."""

    def _innovations(self, rig):
        asked.append(rig)
        size = {"true": -1.5} | {n: v + (-1.5 if n == "true" else 0.0) for n, v in rig.items()}
        known = {n: v for n, v in size.items() if n in SHAPES}
        return np.concatenate([
            NOISE[k] + (1.0 + k) * sum(v * np.tanh(SHAPES[n][k] + 0.1 * v) for n, v in known.items())
            for k in self.looks
        ])  # fmt: skip


asked: list = []


def bench(*looks):
    return Bench({}, None, 0.05, looks or (0, 1), np.ones(3))


def minimum(name):
    """Return change and cost at the minimum of a cause's cost."""
    grid, at = np.linspace(-8.0, 8.0, 161), bench()
    near = grid[int(np.argmin([at._at(Hypothesis(name), g)[2] for g in grid]))]
    best = optimize.minimize_scalar(
        lambda c: at._at(Hypothesis(name), c)[2], bounds=(near - 0.2, near + 0.2), method="bounded",
        options={"xatol": 1e-6},
    )  # fmt: skip
    return float(best.x), float(best.fun)


def test_a_fit_ends_at_the_minimum_of_its_cost_with_the_curvature_as_doubt():
    at = bench()
    for name in ("true", "other"):
        h = Hypothesis(name)
        found = at._fit(h, at._start(h, 0.2), math.inf)
        change, least = minimum(name)
        assert found.cost == pytest.approx(least, rel=1e-4)
        assert found.change == pytest.approx(change, abs=0.1 * found.sigma)
        d = (at._at(h, change + 1e-4)[1] - at._at(h, change - 1e-4)[1]) / 2e-4
        w = at._at(h, change)[1]
        assert found.sigma == pytest.approx(1.0 / math.sqrt(np.sum(5.0 / (4.0 + w**2) * d**2)), rel=0.1)
    bounded = Hypothesis("true", high=0.8)
    assert at._fit(bounded, at._start(bounded, 0.2), math.inf).change == pytest.approx(0.8)
    grainy = at._fit(Hypothesis("true", grain=5.0), at._at(Hypothesis("true"), 1.5), math.inf)
    assert grainy.sigma == pytest.approx(2.5 / 1.959964, rel=1e-5)
    unseen = Hypothesis("of no effect")
    assert at._fit(unseen, at._at(unseen, 1.0), math.inf).sigma == math.inf


def test_a_fit_begins_at_the_best_of_its_starts():
    at = bench()
    for start, expected in ((1.4, 1.4), (-2.0, 1.2), (99.0, 1.2)):
        assert at._start(Hypothesis("true"), start)[0] == pytest.approx(expected)
    assert at._start(Hypothesis("true", high=1.0), 0.0)[0] == 1.0
    far = Hypothesis("other", least=4.0)
    asked.clear()
    at._start(far, 0.5)
    assert sorted(rig["other"] for rig in asked) == [-12.0, 0.5, 12.0, 48.0]


def test_a_hopeless_fit_ends_after_two_steps():
    at, h = bench(), Hypothesis("other")
    first = at._at(h, 5.0)
    whole = at._fit(h, first, math.inf)
    asked.clear()
    early = at._fit(h, first, 0.0)
    assert early.cost > whole.cost and len(asked) <= 10


def test_causes_share_the_probability_by_their_costs_and_explain_parts_of_the_excess():
    every = [Hypothesis(n) for n in SHAPES]
    found = bench().causes(every, np.zeros(len(every)))
    assert len(found) == FINALISTS == 4 and found[0].hypothesis.name == "true"
    least = {n: minimum(n)[1] for n in SHAPES}
    usual = WHITE * 2 * COUNT
    before = cost(bench()._innovations({}))
    phi = max(1.0, least["true"] / usual)
    names = [c.hypothesis.name for c in found]
    weights = {n: math.exp(-(least[n] - least["true"]) / phi) for n in names}
    for c in found:
        n = c.hypothesis.name
        assert c.cost == pytest.approx(least[n], rel=1e-3)
        assert c.probability == pytest.approx(weights[n] / sum(weights.values()), abs=0.02)
        assert c.explained == pytest.approx((before - least[n]) / (before - usual), abs=0.01)
        assert c.change == pytest.approx(0.5 * sum(c.ci95))
    sigma = bench()._fit(Hypothesis("true"), bench()._start(Hypothesis("true"), 0.0), math.inf).sigma
    half = 0.5 * (found[0].ci95[1] - found[0].ci95[0])
    assert half == pytest.approx(1.959964 * sigma * math.sqrt(phi), rel=0.05)
    assert [c.probability for c in found] == sorted((c.probability for c in found), reverse=True)
    assert bench().now() == before and Bench({}, None, 0.05, (), np.ones(3)).now() == 0.0
    asked.clear()
    bench(0, 1)._finalists(every[:1], np.zeros(1))
    clear = [k for k in (0, 1) if cost(bench(k)._innovations({})) == max(bench(0).now(), bench(1).now())]
    assert clear == [1]


def watch(monkeypatch, *hypotheses, models=None):
    """Return what watches two parameters, with a bank and an alarm of its own."""
    stub = SimpleNamespace
    monkeypatch.setattr(changes.hypo, "Bank", lambda *a: stub(args=a))
    monkeypatch.setattr(changes, "Estimates", lambda h: stub(take=lambda *a: None, hypotheses=h))
    monkeypatch.setattr(changes, "Cusum", lambda inner, outer, h: stub(
        inner=inner, outer=outer, h=h, suspects=True, since=3,
        take=lambda *a: alarms.pop() if alarms else False,
    ))  # fmt: skip
    known = hypotheses or (Hypothesis("k"), Hypothesis("b", code="RSEA_Y"))
    scatter = stub(scale=np.ones(3), phi=np.ones(2), excess=lambda evidence: np.array([-1.0, 3.0, 0.5]))
    made = Changes({}, None, known, models or {h.name: h.value for h in known}, scatter, WatchSettings())
    made._began = 7.0
    return made


alarms: list = []


def found(h, change=2.0, probability=0.99, explained=0.9, value=100.0, half=0.25):
    return ChangeCause(h, change, (change - half, change + half), probability, explained, value)


K, B = Hypothesis("k"), Hypothesis("b", code="RSEA_Y")


def test_a_sure_cause_becomes_part_of_the_model(monkeypatch):
    w = watch(monkeypatch, models={"k": 9.5, "b": 10.0})
    told = w.conclude(CandidateCauses([found(K), found(B, probability=0.01)], (), 0.0))
    assert (told.code, told.name, told.since, told.confidence, told.unit) == ("RSEA_X", "k", 7.0, 0.99, "N m")
    assert told.size == 2.5 and told.ci95 == (2.25, 2.75)
    assert w.findings == {"k": told} and w._base.rig == {"k": 2.0}
    assert [h.value for h in w._base.hypotheses] == [12.0, 10.0]
    assert w._before.last == "k" and w._base.since == 7.0 - changes.hypo.FILTER_SETTLING
    assert w._cusum.inner.tolist() == [0.5, 0.5, 2.0, 2.0, 2.0]
    assert w._cusum.outer.tolist() == [1.0, 1.0, 5.0, 5.0, 5.0]
    assert w._cusum.h == changes.threshold(1e-3, 7, 3.0)


def test_two_causes_of_one_code_are_sure_together(monkeypatch):
    other = replace(B, code="RSEA_X")
    for probability, is_sure in ((0.5, True), (0.44, False)):
        w = watch(monkeypatch, K, other)
        both = [found(K, probability=0.5), found(other, probability=probability)]
        w.conclude(CandidateCauses(both, (), 0.0))
        assert (w._base.rig == {"k": 2.0}) == is_sure


@pytest.mark.parametrize(("size", "is_told"), [(0.56, True), (-0.56, True), (0.54, False)])
def test_a_change_within_the_doubt_of_the_model_is_adopted_in_silence(monkeypatch, size, is_told):
    assert _is_change(K, size) == is_told
    w = watch(monkeypatch)
    told = w.conclude(CandidateCauses([found(K, size)], (), 0.0))
    assert (told is not None) == is_told == bool(w.findings) == (w._before is not None)
    assert w._base.rig == {"k": size}


def test_an_unsure_cause_is_told_once_and_waited_for_ever_longer(monkeypatch):
    w, waits = watch(monkeypatch), []
    for k in range(7):
        told = w.conclude(CandidateCauses([found(K, probability=0.7), found(B, probability=0.3)], (), 0.0))
        assert (told is not None) == (k == 0)
        waits.append(w._wait)
    assert waits == [2, 6, 14, 30, 62, 64, 64] and w.findings["k"].confidence == 0.7
    assert w._base.rig == {} and not w.suspects
    quiet = watch(monkeypatch)
    assert quiet.suspects
    assert quiet.conclude(CandidateCauses([found(K, 0.3, 0.7), found(B, probability=0.3)], (), 0.0)) is None
    assert not quiet.findings
    w._began = 50.0
    told = w.conclude(CandidateCauses([found(K)], (), 0.0))
    assert told.since == 7.0 and w.findings == {"k": told} and w._patience == 0


def test_a_change_that_no_cause_explains_is_said_after_patience(monkeypatch):
    w, told = watch(monkeypatch), []
    for _ in range(4):
        told.append(w.conclude(CandidateCauses([found(K, explained=0.49)], (), 0.0)))
    assert told[:2] == [None, None] and told[2].code == UNEXPLAINED == told[2].name and told[3] is None
    assert told[2].confidence == pytest.approx(0.51) and told[2].since == 7.0
    w.conclude(CandidateCauses([found(K, probability=0.7), found(B, probability=0.3)], (), 0.0))
    assert list(w.findings) == ["k"]


@pytest.mark.parametrize(("instead", "is_one"), [(114.9, True), (115.1, False)])
def test_one_cause_in_place_of_two_may_cost_a_little_more(monkeypatch, instead, is_one):
    w = watch(monkeypatch)
    w.conclude(CandidateCauses([found(K)], (), 0.0))
    told = w.conclude(CandidateCauses([found(B, value=100.0)], [found(B, 3.0, value=instead)], 10.0))
    assert set(w.findings) == ({"b"} if is_one else {"k", "b"}) and told.name == "b"
    assert w._base.rig == ({"b": 3.0} if is_one else {"k": 2.0, "b": 2.0})


def look(t):
    return SimpleNamespace(t=[t])


def test_an_alarm_asks_for_fits_to_looks_of_the_change(monkeypatch):
    w = watch(monkeypatch)
    evidence = SimpleNamespace(scale_sums=lambda scale: (np.array([4.0, 0.0]), np.diag([2.0, 0.0])))
    fitted = []
    fitter = SimpleNamespace(causes=lambda h, starts: [tuple(starts)], now=lambda: 5.0)
    w._fitter = lambda base, looks: fitted.append((base, [x.t[0] for x in looks])) or fitter
    for k in range(6):
        w.take(look(float(k)), evidence)
    assert w.job is None
    alarms.append(True)
    w.take(look(6.0), evidence)
    assert w._began == 4.0 + changes.hypo.FILTER_SETTLING
    assert w.job().beside == [(2.0, 0.0)] and fitted == [(w._base, [4.0, 5.0, 6.0])]
    w._before, w._wait = w._base, 2
    w.job, fitted[:] = None, []
    for k in (7.0, 8.0):
        alarms.append(True)
        w.take(look(k), evidence)
        assert (w.job is None) == (k == 7.0)
    answer = w.job()
    assert [at for _, at in fitted] == [[6.0, 7.0, 8.0], [0.0, 1.0, 6.0, 7.0, 8.0], [0.0, 1.0]]
    assert answer.first == 5.0


def test_looks_are_spread_with_the_newest_among_them():
    every = list(range(10))
    assert _spread(every, 4) == [0, 3, 6, 9] and _spread(every[:3], 4) == [0, 1, 2] and _spread([5], 4) == [5]
