"""A record whose every message was logged twice: what follows from its rate must not be of the copies."""

import numpy as np
import pytest

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel


def test_the_rate_is_that_of_the_samples_without_their_copies():
    rig = load_rig("paper_high_impedance")
    t = np.arange(12 * 280) / 280.0
    once = synthesize(rig.with_effect("backlash"), Channel(t, 8.0 * np.sin(2.0 * np.pi * 2.0 * t)))
    twice = once.with_channels(
        **{n: Channel(np.repeat(c.t, 2), np.repeat(c.y, 2)) for n, c in once.channels.items()}
    )
    diagnosis = diagnose([twice], rig)
    assert diagnosis.rate == pytest.approx(280.0)
