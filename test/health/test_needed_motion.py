"""What a sensor that stands still, is silent or sends no numbers is measured by, from values by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rsea_ros.health.health_finding import Sensors, sensor_findings
from rsea_ros.model.observer.log import COMMAND, FT, STATE
from rsea_ros.model.rig import EffectSetting, Sensor

K = 1500.0


class Rig:
    """A rig's sensors, spring and friction."""

    def __init__(self, *, rigid=False, friction=0.0, **sensors):
        self.sensors, self.rigid_spring = sensors, rigid
        rub, play = {"torque": friction}, {"gap": 9.0}
        self.effects = [EffectSetting("coulomb_friction", rub), EffectSetting("backlash", play)]

    def __getitem__(self, name):
        assert name == "spring.stiffness" and not self.rigid_spring
        return K


SENSED = {"ft": Sensor(noise=0.2), "position": Sensor(noise=1e-4, quantum=3e-4),
          "motor_torque": Sensor(noise=0.5)}  # fmt: skip


@pytest.mark.parametrize(
    ("options", "name", "other", "needed"),
    [
        ({}, "motor_torque", "command", 12.0 * 0.5),
        ({}, "ft", "position", 12.0 * 3e-4),
        ({}, "position", "ft", max(12.0 * 0.2, 12.0 * K * 3e-4)),
        ({"friction": 4.0}, "position", "ft", 12.0 * K * 3e-4),
        ({"friction": 4.0}, "position", "command", 12.0 * K * 3e-4 + 12.0),
        ({"friction": 4.0}, "ft", "command", 12.0 * K * 3e-4 + 12.0),
        ({"rigid": True, "friction": 4.0}, "position", "command", 12.0),
        ({"rigid": True}, "position", "command", 12.0 * 0.5),
        ({"rigid": True, "friction": 4.0}, "motor_torque", "command", 6.0),
    ],
)
def test_another_signal_must_move_by_what_this_one_would_show(options, name, other, needed):
    assert Sensors(Rig(**SENSED, **options))._needed_motion(name, other) == pytest.approx(needed)


def test_a_command_is_as_noisy_as_the_torque_that_is_measured():
    for left, noise in (({}, 0.5), ({"motor_torque"}, 0.2), ({"motor_torque", "ft"}, 1e-3)):
        sensed = {n: s for n, s in SENSED.items() if n not in left}
        assert Sensors(Rig(**sensed))._noise["command"] == noise
    quiet = Sensors(Rig(ft=Sensor(noise=0.0)))
    assert quiet._noise == {"ft": 1e-12, "command": 1e-12}
    assert quiet._needed_motion("ft", "position") == 0.0


def events(*rows):
    """Return t, kinds and values of events."""
    t, kind, *values = zip(*rows, strict=True)
    return np.array(t, float), np.array(kind), np.array(values, float).T


def ramp(first, last, ft, *, moves=10.0, command=math.nan):
    """Return events at 100 Hz: states that move, and what ft shows."""
    made = []
    for k in range(first, last):
        t = 0.01 * k
        made += [(t, STATE, moves * t, moves * t), (t, FT, ft(t), math.nan)]
        if math.isfinite(command):
            made.append((t, COMMAND, command * t, math.nan))
    return events(*made)


def test_a_sensor_stands_still_from_ten_values_and_a_twentieth_of_a_second_on():
    sensors = Sensors(Rig(**SENSED))
    sensors.take(*ramp(0, 20, lambda t: t))
    sensors.take(*ramp(20, 29, lambda t: 5.0))
    assert sensors.frozen == {}
    sensors.take(*ramp(29, 30, lambda t: 5.0))
    assert sensors.frozen == {"ft": pytest.approx(0.2)}
    sensors.take(*ramp(30, 31, lambda t: 6.0))
    assert sensors.frozen == {}
    slow = Sensors(Rig(**SENSED))
    slow.take(*ramp(0, 30, lambda t: 5.0, moves=0.0))
    assert slow.frozen == {}
    slow.take(*ramp(30, 31, lambda t: 5.0, moves=1.0))
    assert "ft" in slow.frozen


def test_a_sensor_is_missing_after_a_second_and_silence_counts():
    sensors = Sensors(Rig(**SENSED))
    sensors.take(*events((10.0, STATE, 0.0, 0.0), (11.0, STATE, 0.1, 0.1)))
    assert sensors.missing == {}
    sensors.hear_nothing(0.01)
    assert sensors.missing == {"ft": 10.0}
    sensors.hear_nothing(1.01)
    assert sensors.missing == {"ft": 10.0, "position": 11.0, "motor_torque": 11.0}
    sensors.take(*events((11.5, FT, 1.0, math.nan)))
    assert sensors.missing == {}
    sensors.begin()
    assert sensors.missing == {} and sensors.frozen == {}


def test_values_that_are_no_numbers_are_counted_beside_numbers():
    sensors = Sensors(Rig(**SENSED))
    sensors.take(*events((0.0, FT, math.nan, math.nan)))
    assert sensors.bad_values == 0
    sensors.take(*events((0.1, FT, 1.0, 0.0), (0.2, FT, math.inf, 0.0), (0.3, COMMAND, math.nan, 0.0)))
    assert sensors.bad_values == 1
    (bad,) = sensor_findings(sensors, 2, 3)
    assert (bad.code, bad.name) == ("RSEA_BAD_DATA", "1 no numbers, 2 jumps of the stamps, 3 late samples")
    assert math.isnan(bad.since) and bad.confidence == 1.0
    sensors.bad_values = 0
    assert sensor_findings(sensors, 0, 0) == []
    assert sensor_findings(sensors, 0, 4)[0].name == "4 late samples"
