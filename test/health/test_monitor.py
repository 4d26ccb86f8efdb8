"""The whole watch on a bench that shares no code with the model: changes are named and sized."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from independent.bench import Bench, record_command

from rsea_ros.errors import RigError
from rsea_ros.health.health_finding import WatchSettings
from rsea_ros.health.hypotheses import Bank, Cutter
from rsea_ros.health.monitor import Monitor, learn
from rsea_ros.model.observer import noise_of
from rsea_ros.model.observer.log import events_of
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig

RATE, CLEAN, AFTER = 280.0, 14.0, 8.0
BENCH = Bench().with_values(coulomb=3.0, b_m=8.0)
SETTINGS = WatchSettings(learn=6, every=0.25, fitted=3)


def rig():
    """The rig of the bench, off by what its last identification doubts."""
    p = BENCH.plant
    known = load_rig("paper_high_impedance").with_values(
        {"rotor.reflected_inertia": 1.002 * p.j_m, "rotor.reflected_damping": 0.98 * p.b_m,
         "spring.stiffness": 1.005 * p.k_s, "spring.damping": p.b_s}
    )  # fmt: skip
    return known.with_effects(EffectSetting("coulomb_friction", {"torque": 1.03 * p.coulomb}))


def command(seconds, seed):
    """A gait of random phases on a load that changes its sign, N m."""
    t, rng = np.arange(round(seconds * RATE)) / RATE, np.random.default_rng(seed)
    waves = [8.0 / h * np.sin(2 * np.pi * 1.1 * h * t + rng.uniform(0, 6.28)) for h in (1, 2, 3, 4)]
    return np.sum(waves, axis=0) * np.clip(t / 0.5, 0.0, 1.0)


def play(monitor, bench, seconds, rng, *, start=0.0, noted=lambda: None):
    """Let a monitor watch a bench and conclude its jobs; noted: called after each fifth of a second or so."""
    t, kind, values = events_of(record_command(bench, command(seconds, 2), rng))
    for k in range(0, len(t), 210):
        monitor.take(t[k : k + 210] + start, kind[k : k + 210], values[k : k + 210])
        noted()
        if monitor.job is not None:
            monitor.conclude(monitor.job())


@pytest.fixture(scope="module")
def clean():
    """A monitor after a clean record, its noise, and what it had learned when the learning was over."""
    monitor, rng, learned = Monitor(rig(), noise_of(rig()), SETTINGS), np.random.default_rng(1), []

    def note():
        if not monitor.learning and not learned:
            learned.append(deepcopy(monitor.changes))

    play(monitor, BENCH, CLEAN, rng, noted=note)
    return monitor, rng, learned[0]


def watched_on(clean, **fault):
    """Return a copy of that monitor after eight more seconds with a fault."""
    monitor, rng, _ = clean
    monitor = deepcopy(monitor, {id(monitor._learning): None})  # it has ended, and no copy is made of it
    play(monitor, BENCH.with_values(**fault), AFTER, deepcopy(rng), start=CLEAN)
    return monitor


def test_a_healthy_joint_is_not_alarmed_and_its_parameters_are_right(clean):
    monitor = watched_on(clean)
    assert monitor.findings() == [] and not monitor.learning
    values = {e.name: e for e in monitor.estimates()}
    low, high = values["spring.stiffness"].ci95
    assert low < BENCH.plant.k_s < high and high - low < 0.03 * BENCH.plant.k_s
    changes, before = monitor.changes, monitor.changes._cusum.h
    monitor.watch(replace(SETTINGS, rate=1e3 * SETTINGS.rate, every=2.0 * SETTINGS.every))
    assert monitor.changes is changes, "what has been learned stays"
    assert changes._cusum.h < before - 3.0 and monitor._cutter.every == 2.0 * SETTINGS.every


def test_a_joint_in_a_position_loop_is_refused():
    with pytest.raises(RigError, match="a position loop commands it"):
        Monitor(load_rig("pd_joint"), noise_of(rig()))


def test_a_change_is_named_and_sized(clean):
    k_s = BENCH.plant.k_s
    (finding,) = watched_on(clean, k_s=0.85 * k_s).findings()
    assert finding.code == "RSEA_STIFFNESS" and finding.confidence > 0.95
    assert finding.size == pytest.approx(-0.15 * k_s, abs=0.02 * k_s)
    assert finding.ci95[0] < finding.size < finding.ci95[1]
    assert CLEAN - 1.0 < finding.since < CLEAN + 3.0


def test_learning_examines_no_look_before_the_last_one_is_a_while_ago(monkeypatch):
    pace, examined, evidence = 1.0, [], Bank.evidence
    monitor = Monitor(rig(), noise_of(rig()), WatchSettings(learn=6, every=pace))

    def noted(bank, look):
        examined.append(monitor.now)
        return evidence(bank, look)

    monkeypatch.setattr(Bank, "evidence", noted)
    events = events_of(record_command(BENCH, command(30.0, 2), np.random.default_rng(1)))
    for k in range(0, len(events[0]), 70):
        if monitor.learning:
            monitor.take(*(part[k : k + 70] for part in events))
    assert not monitor.learning and len(examined) == 3 * 6 and min(np.diff(examined)) >= pace


def test_learning_over_a_while_is_learning_at_one_go(clean):
    """No look counts but the first ones, and the values are those of the bench."""
    t, kind, values = events_of(record_command(BENCH, command(CLEAN, 2), np.random.default_rng(1)))
    first = [look for look in Cutter(1.0).take(t, kind, values) if look.travel() > 0.01][:6]
    steps, (_, _, slowly) = learn(rig(), noise_of(rig()), first, SETTINGS), clean
    with pytest.raises(StopIteration) as end:
        while True:
            next(steps)
    at_once = end.value.value
    learned = {h.name: (h.value, h.common) for h in slowly._base.hypotheses}
    assert learned == {h.name: (h.value, h.common) for h in at_once._base.hypotheses}
    assert slowly._scatter.scale == pytest.approx(at_once._scatter.scale, rel=1e-12)
    assert learned["spring.stiffness"][0] == pytest.approx(BENCH.plant.k_s, rel=2e-3)
    assert learned["coulomb_friction.torque"][0] == pytest.approx(BENCH.plant.coulomb, rel=0.02)


def test_a_change_that_no_cause_explains_is_not_looked_at_closer_for_ever():
    """Looks of each second and fits that find nothing would take more of a core than a joint may have."""
    settings, rng = WatchSettings(learn=4, every=2.0, fitted=2), np.random.default_rng(1)
    monitor, looks = Monitor(rig(), noise_of(rig()), settings), [0.0]

    def note():
        looks.extend([monitor.now] * (monitor.looks - len(looks) + 1))

    play(monitor, BENCH, 24.0, rng, noted=note)
    play(monitor, BENCH.with_values(resonance=0.4), 30.0, rng, start=24.0, noted=note)
    assert [f.code for f in monitor.findings()] == ["RSEA_UNEXPLAINED"]
    assert min(np.diff(looks[-4:])) > 1.5
