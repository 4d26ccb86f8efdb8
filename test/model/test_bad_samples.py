"""One value that is no measurement leaves nothing behind in observer and flags."""

import math

import pytest

from rsea_ros.model.observer import Observer, TorqueEstimate
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.records.record import is_measured

RIG = load_rig("paper_high_impedance")
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


@pytest.mark.parametrize("value", [None, *BAD[:3]])
def test_not_measured_is_one_thing(value):
    assert not is_measured(value)
    assert is_measured(0.0) and not is_measured(-700.0, 680.0)
