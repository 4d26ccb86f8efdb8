"""The figures of the model never end a node, and values that are not numbers are no torque."""

import math

import numpy as np
import pytest

from rsea_ros.model.observer import ErrorModel, Observer, TorqueEstimate
from rsea_ros.model.observer.assemble import consistency
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand

RATE, SIGMA = 1000.0, 0.005
SETTLED = ErrorModel(np.array([[0.5]]), np.array([[0.0, 0.5]]), np.array([0.0, SIGMA**2]), np.ones(1), SIGMA)
RIG = load_rig("paper_high_impedance")


def band(error=SETTLED):
    made = TorqueBand(RIG)
    made.calibrate(error, 1.0 / RATE)
    return made


def run(made, torque, seconds, start=0.0, sigma=SIGMA):
    """Whether a torque of the time is heard."""
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
def test_a_threshold_that_is_no_number_is_no_torque(growth):
    """The noise of an observer that does not settle overflows."""
    made = band()
    assert run(made, slow, 1.0)[-1]
    made.calibrate(SETTLED._replace(a=np.array([[growth]])), 1.0 / RATE)
    assert not run(made, slow, 0.5, start=1.0)[-1]


def test_stamps_that_go_back_begin_anew():
    """An hour back: the flag stood still for an hour."""
    made = band()
    run(made, slow, 1.0, start=3600.0)
    run(made, lambda t: math.sin(2.0 * math.pi * 100.0 * t), 1.0)
    assert made.occupied().hz == pytest.approx(100.0, rel=0.05)


BAD = [math.nan, math.inf, -math.inf, 1e300]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("what", ["ft", "state", "command", "effort", "stamp"])
def test_the_observer_goes_on(what, bad):
    observer = Observer(RIG)
    for k in range(60):
        t, wrong = k / 280.0, k == 30
        observer.command(t, bad if wrong and what == "command" else 2.0)
        effort = bad if wrong and what == "effort" else 2.0
        observer.state(t, bad if wrong and what == "state" else 2.0 / 1530.456, effort)
        late = bad if wrong and what == "stamp" and not math.isfinite(bad) else t
        estimate = observer.ft(late, bad if wrong and what == "ft" else 2.0)
    assert all(math.isfinite(value) for value in estimate)
    assert estimate.distal == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("kind", [TorqueBand, ErrorFlag])
def test_the_flags_go_on(kind, bad):
    flag, seen = kind(RIG), []
    for k in range(400):
        value = bad if k == 100 else 10.0 * math.sin(2.0 * math.pi * k / 280.0)
        seen.append(flag.take(k / 280.0, TorqueEstimate(value, value, 0.0, 0.01, 0.01, 0.01)))
    share = flag.share if kind is ErrorFlag else 0.0
    assert math.isfinite(share) and len(seen) == 400
    if kind is ErrorFlag:
        assert seen[-1] == 1
