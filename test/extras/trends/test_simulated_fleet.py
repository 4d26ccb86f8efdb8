"""The simulated fleet of the benches, as the alarms see it."""

import numpy as np

from bench.fleet.trends import DAYS, Wear, _joint
from rsea_extras.trends import alarms


def test_spoilt_data_of_a_joint_raise_the_alarm():
    wear = Wear("fault", since=100.0, fault="outliers")
    history, recordings = _joint("J01", wear, np.full(DAYS, 25.0), np.random.default_rng(1))
    assert "J01/outliers/fault" in [alarm.key for alarm in alarms(history, recordings)]
