"""The figures of the model never end a node, and values that are not numbers never raise the flag."""

import math
from itertools import pairwise

import numpy as np
import pytest

from rsea_ros.model.observer import ErrorModel, Observer, TorqueEstimate
from rsea_ros.model.observer.signal_noise import consistency
from rsea_ros.model.pure_torque import PureTorque
from rsea_ros.model.rig_file import load_rig

RATE, SIGMA = 1000.0, 0.005
SETTLED = ErrorModel(np.array([[0.5]]), np.array([[0.0, 0.5]]), np.array([0.0, SIGMA**2]), np.ones(1), SIGMA)
RIG = load_rig("paper_high_impedance")


def flag(error=SETTLED):
    made = PureTorque(RIG)
    made.calibrate(error, 1.0 / RATE)
    return made


def run(made, torque, seconds, start=0.0, sigma=SIGMA):
    """Verdicts on a torque of the time."""
    times = start + np.arange(round(seconds * RATE)) / RATE
    noise = SIGMA * np.random.default_rng(1).normal(size=len(times))
    read = [torque(t) for t in times] + noise
    return [
        made.take(t, TorqueEstimate(y, 0.0, 0.0, sigma, 0.0, 0.0)) for t, y in zip(times, read, strict=True)
    ]


def slow(t):
    return math.sin(2.0 * math.pi * 5.0 * t)


def test_innovations_that_a_late_command_has_taken_back_give_a_figure():
    """Sums of squares went down between two reports: math domain error."""
    tests = consistency(np.array([[-1.0, 50.0, 0.1], [60.0, 50.0, 0.0], [math.nan, 50.0, 0.0]]))
    assert tests["position"].ratio == 0.0 and tests["ft"].ratio > 1.0 and "motor_torque" not in tests


def test_commands_after_a_report_never_raise():
    observer = Observer(RIG, hold=0.05)
    for k in range(400):
        t = k / 280.0
        observer.state(t, 0.05 * math.sin(20.0 * t), 5.0)
        observer.ft(t, 20.0 * math.sin(20.0 * t))
        if k % 7 == 0:
            observer.consistency()
        observer.command(t - 0.02, 30.0 * math.sin(20.0 * t))
        assert all(math.isfinite(test.ratio) for test in observer.consistency().values())


@pytest.mark.parametrize("growth", [2.0, math.nan])
def test_a_threshold_that_is_no_number_is_not_pure(growth):
    """The noise of an observer that does not settle overflows."""
    made = flag()
    assert run(made, slow, 1.0)[-1] == "pure"
    made.calibrate(SETTLED._replace(a=np.array([[growth]])), 1.0 / RATE)
    assert run(made, slow, 0.5, start=1.0)[-1] == "no torque"


def test_an_estimate_that_is_no_number_is_not_pure():
    made = flag()
    assert run(made, slow, 1.0)[-1] == "pure"
    assert run(made, lambda t: math.nan, 0.01, start=1.0)[-1] == "no torque"


def test_a_slow_and_a_fast_torque_together_do_not_make_it_flutter():
    """Ten changes a second for 5 Hz 0.5 N m and 70 Hz 0.4 N m."""
    verdicts = run(flag(), lambda t: 0.5 * slow(t) + 0.4 * math.sin(2.0 * math.pi * 70.0 * t), 6.0)
    changes = sum(a != b for a, b in pairwise(verdicts[1000:]))
    assert changes <= 2, changes
    assert run(flag(), slow, 2.0)[-1] == "pure"


def test_stamps_that_go_back_begin_anew():
    """An hour back: the flag stood still for an hour."""
    made = flag()
    assert run(made, slow, 1.0, start=3600.0)[-1] == "pure"
    fast = run(made, lambda t: math.sin(2.0 * math.pi * 100.0 * t), 1.0)
    assert fast[-1] == "beyond"
