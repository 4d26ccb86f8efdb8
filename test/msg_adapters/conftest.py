"""Shared by the tests of bags."""

import numpy as np
import pytest

from rsea_ros.records.record import Channel, Record

EPOCH = 1_763_000_000_123_456_789


@pytest.fixture
def record() -> Record:
    """Return two seconds of all channels, with stamps that differ between the topics."""
    rng = np.random.default_rng(3)
    t = np.rint(np.arange(560) / 280 * 1e9) * 1e-9

    def channel(offset: float) -> Channel:
        return Channel(t + offset, rng.normal(size=t.size))

    names = {
        "command": 0.0,
        "position": 1e-3,
        "velocity": 1e-3,
        "motor_torque": 1e-3,
        "ft": 1.5e-3,
        "reference": 2e-3,
    }
    return Record({name: channel(offset) for name, offset in names.items()}, "bench", EPOCH)
