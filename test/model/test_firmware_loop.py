"""A position loop in the simulation, against scipy."""

from dataclasses import replace

import numpy as np
import pytest
import slow

from rsea_ros.model.rig import PositionLoop
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Record

RATE = 1000.0
T = np.arange(1500) / RATE
STAMPS = T + 1 / RATE


def reference(t):
    return 0.3 * (1 - np.cos(2 * np.pi * t))


def record_of(outside):
    """Return a record whose command has `outside` beside the measured motor torque."""
    motor = np.sin(T)
    blank = {n: Channel(STAMPS.copy(), np.zeros(len(T))) for n in ("position", "velocity")}
    given = {"command": motor + outside, "motor_torque": motor, "reference": reference(T)}
    return Record({n: Channel(T.copy(), y) for n, y in given.items()} | blank, source="bag")


@pytest.mark.parametrize(
    ("controller", "outside"),
    [
        (PositionLoop(k_p=8.0, k_v=20.0), np.zeros(len(T))),
        (PositionLoop(k_p=8.0, k_v=20.0), np.where(T > 0.5, 3.0, 0.0)),
        (PositionLoop(k_p=30.0, k_v=40.0, limit=12.0), np.zeros(len(T))),
    ],
    ids=["tracking", "disturbed", "limited"],
)
def test_the_closed_loop_is_that_of_scipy(controller, outside):
    def law(k, q, v, step):
        wanted = np.interp(k / RATE, T, reference(T))
        u = controller.k_v * (controller.k_p * (wanted - q) - v)
        return np.clip(u, -controller.limit, controller.limit) + outside[int(k + 1e-9)]

    rig = replace(load_rig("bare_drive"), controller=controller)
    ours, true = simulate(rig, record_of(outside)), slow.closed_loop(rig, law, 1 / RATE, 3, len(T))
    for channel, expected in zip(("position", "velocity"), true, strict=True):
        np.testing.assert_allclose(ours[channel], expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_without_a_measured_motor_torque_nothing_but_the_loop_acts():
    record = record_of(np.sin(T))
    same = record.with_channels(motor_torque=record["command"])
    without = replace(record, channels={n: c for n, c in record.channels.items() if n != "motor_torque"})
    rig = replace(load_rig("bare_drive"), controller=PositionLoop(8.0, 20.0))
    expected = simulate(rig, same)
    for name, values in simulate(rig, without).items():
        np.testing.assert_array_equal(values, expected[name])
