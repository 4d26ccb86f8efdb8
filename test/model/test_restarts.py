"""A gap of the whole record: what was commanded in it is unknown, so the simulation begins anew behind it."""

from __future__ import annotations

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.model.restarts import gaps
from rsea_ros.model.rig_file import load_rig
from rsea_ros.signals import Channel

RIG = load_rig("paper_high_impedance")
SOUND = rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(4200), rate=280.0, seed=1)


def without(*spans, names=tuple(SOUND.channels)):
    """Return the record without the rows of some spans, s."""
    keep = {n: np.all([(c.t < a) | (c.t >= b) for a, b in spans], axis=0) for n, c in SOUND.channels.items()}
    return SOUND.with_channels(**{n: Channel(SOUND[n].t[keep[n]], SOUND[n].y[keep[n]]) for n in names})


@pytest.mark.parametrize("spans", [[(5.0, 8.0)], [(3.0, 4.0), (8.0, 8.5)]])
def test_predict_and_identify_leave_only_noise_beside_a_gap(spans):
    """37 times the noise after 8 s without rows: the last command was held and its end state gone on with."""
    record = without(*spans)
    before, after = rsea.predict("paper_high_impedance", SOUND), rsea.predict(RIG, record)
    for n in ("ft", "position", "velocity"):
        assert after[n].rms_error == pytest.approx(before[n].rms_error, rel=0.1)
    fit = rsea.identify(record, RIG)
    assert max(fit.result.times_noise.values()) < 1.15
    assert fit.rig["spring.stiffness"] == pytest.approx(1530.456, abs=1.0)


def test_commands_that_pause_alone_are_held():
    assert gaps(without((5.0, 8.0), names=("command",))) == []
    (only,) = gaps(without((5.0, 8.0)))
    assert only == pytest.approx((5.0, 8.0), abs=0.01)


def test_a_short_gap_goes_on_with_the_last_command():
    assert gaps(without((5.0, 5.03))) == []
