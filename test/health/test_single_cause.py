"""Fits of single causes to some looks: which is right, and how much of the filter that takes."""

import numpy as np
from independent.bench import Bench, record_command

from rsea_ros.health.changes import FINALISTS, Fitter
from rsea_ros.health.hypotheses import Cutter, hypotheses_of
from rsea_ros.model.observer import noise_of
from rsea_ros.model.observer.log import BatchObserver, events_of
from rsea_ros.model.rig_file import load_rig

RATE = 280.0


def looks_of(**fault):
    """Four looks of the bench with a fault."""
    t = np.arange(round(6.0 * RATE)) / RATE
    gait = sum(8.0 / h * np.sin(2 * np.pi * 1.1 * h * t + h) for h in (1, 2, 3, 4))
    gait *= np.clip(2.0 * t, 0.0, 1.0)
    run = record_command(Bench().with_values(**fault), gait, np.random.default_rng(1))
    return list(Cutter(1.25).take(*events_of(run)))[-4:]


def test_only_the_causes_that_explain_the_clearest_look_are_fitted_to_all(monkeypatch):
    looks, runs = looks_of(gap=4e-3), []
    innovations = BatchObserver.innovations

    def counted(self, t, *args):
        runs.append(float(t[0]))
        return innovations(self, t, *args)

    monkeypatch.setattr(BatchObserver, "innovations", counted)
    rig = load_rig("paper_high_impedance")
    hypotheses = hypotheses_of(rig, 1.0 / RATE)
    fitter = Fitter(rig, noise_of(rig), 0.1, looks, np.ones(3))
    causes = fitter.causes(hypotheses, np.zeros(len(hypotheses)))
    assert causes[0].hypothesis.code == "RSEA_BACKLASH" and causes[0].probability > 0.99
    assert abs(causes[0].change - 4e-3) < 2e-4
    assert len(causes) == FINALISTS < len(hypotheses)
    counts = sorted(runs.count(float(look.t[0])) for look in looks)
    assert len(looks) == 4 and counts[0] == counts[2] < 0.5 * counts[3]
