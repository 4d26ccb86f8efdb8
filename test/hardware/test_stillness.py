"""An F/T sensor whose counters go on and whose values have stopped is recognised by its missing noise."""

import math

import pytest

from rsea_ros.hardware.netft.rdt import RdtRecord
from rsea_ros.hardware.netft.receiver import Arrival
from rsea_ros.hardware.netft.sensor import Stillness

MS = 1_000_000


def records(values, start=0, every=MS):
    """Records 1 ms apart whose last torque has these counts."""
    return [
        Arrival(0, RdtRecord(k, k, 0, (0, 0, 0, 0, 0, value)), start + k * every)
        for k, value in enumerate(values)
    ]


def calibrate(values):
    made = Stillness()
    made.calibrate(records(values))
    return made


@pytest.mark.parametrize(
    ("rest", "limit"),
    [
        ([0, 1] * 50, 50 * MS),
        ([0] * 8 + [1] * 8 + [0] * 84, 80 * MS),  # a quiet sensor repeats its values
        ([7] * 100, math.inf),  # one without noise always may
        ([7], math.inf),
        ([], math.inf),
    ],
)
def test_the_limit_is_ten_times_the_longest_rest_of_its_values(rest, limit):
    assert calibrate(rest).limit == limit


def test_values_that_stop_are_a_fault_until_they_change():
    sensor = calibrate([0, 1] * 50)
    assert sensor.take(records([5, *[9] * 50], start=1000 * MS)) == ""
    assert not sensor.stopped
    told = sensor.take(records([9] * 10, start=1052 * MS))
    assert told == "all six values unchanged for 60 ms: the sensor has stopped" and sensor.stopped
    assert sensor.take([]) == "" and sensor.stopped
    assert sensor.reason(records([9] * 100)) == "all six values unchanged for 99 ms: the sensor has stopped"
    assert sensor.reason(records([9] * 50 + [8] * 50)) == ""
    sensor.restart()
    assert not sensor.stopped and sensor.take(records([9] * 40, start=2000 * MS)) == ""


def test_a_sensor_without_noise_may_stand_still():
    sensor = calibrate([7] * 100)
    assert sensor.take(records([7] * 5000)) == "" and sensor.reason(records([7] * 100)) == ""
