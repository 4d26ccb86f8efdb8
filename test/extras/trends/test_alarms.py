"""Causes, faults and outliers: since when, compared with the fleet, and with stable keys."""

from __future__ import annotations

import numpy as np
import pytest
from fleet_histories import DAY, START, cause, history, recordings

from rsea_extras.trends import alarms, fleet_trends
from rsea_extras.trends.alarms import by_joint
from rsea_extras.trends.appearing import adjust, scan_p, scan_threshold

JOINTS = tuple("abcdefgh")
QUIET = history(np.random.default_rng(0), joints=JOINTS, days=60, each=1)


def draws(seed, share):
    """Return whether joint and day draw something of some probability, always the same for a seed."""
    return lambda joint, d: np.random.default_rng([seed, ord(joint), d]).random() < share


def test_a_cause_that_appears_is_dated_and_sized():
    miss = draws(1, 0.25)
    names = recordings(
        JOINTS, 120,
        causes=lambda j, d: [cause("backlash", 2e-3)] if j == "c" and d >= 70 and not miss(j, d) else [],
    )  # fmt: skip
    (alarm,) = alarms(QUIET, names)
    assert (alarm.joint, alarm.about, alarm.kind, alarm.key) == ("c", "backlash", "cause", "c/backlash/cause")
    assert abs((alarm.since_s - START) / DAY - 70.0) <= 4.0
    assert alarm.size.low < 2e-3 < alarm.size.high
    assert alarm.recording >= "bag00070"


def test_a_cause_that_all_joints_have_is_no_alarm():
    names = recordings(JOINTS, 60, causes=lambda j, d: [cause("coulomb_friction", 1.0, "torque", "N m")])
    assert alarms(QUIET, names) == ()


def test_a_cause_of_one_joint_from_its_first_recording_is_an_alarm():
    names = recordings(JOINTS, 60, causes=lambda j, d: [cause("backlash", 2e-3)] if j == "b" else [])
    (causes,) = fleet_trends(QUIET, names).appearances
    assert causes.from_first
    assert causes.joint == "b"


def test_a_name_given_in_error_now_and_then_is_no_alarm():
    wrong = draws(2, 0.03)
    names = recordings(JOINTS, 250, causes=lambda j, d: [cause("backlash", 2e-3)] if wrong(j, d) else [])
    assert alarms(QUIET, names) == ()


def test_two_days_that_name_it_are_not_enough():
    causes = [cause("backlash", 2e-3)]
    names = recordings(JOINTS, 9, causes=lambda j, d: causes if j == "c" and d >= 7 else [])
    assert alarms(QUIET, names) == ()


def test_an_unlikely_rival_does_not_count():
    names = recordings(
        JOINTS, 60, causes=lambda j, d: [cause("backlash", 2e-3, status="one_of", probability=0.3)]
    )
    assert fleet_trends(QUIET, names).namings == ()


def test_the_detection_limit_is_the_size_of_the_least_gain():
    noise, slope = 1.0, 2000.0
    sizes = np.geomspace(1e-3, 4e-3, 60)
    gains = 1.0 - noise / np.sqrt(noise**2 + (slope * sizes) ** 2)
    names = recordings(("a",), 60, causes=lambda j, d: [cause("backlash", sizes[d], gain=gains[d])])
    (naming,) = fleet_trends(QUIET, names).namings
    rest = np.sqrt(noise**2 + (slope * naming.limit) ** 2)
    assert 1.0 - noise / rest == pytest.approx(0.05)


def test_bad_data_since_some_day_is_a_fault():
    names = recordings(JOINTS, 60, faults=lambda j, d: [{"kind": "outliers"}] if j == "e" and d >= 30 else [])
    (alarm,) = alarms(QUIET, names)
    assert (alarm.joint, alarm.kind, alarm.about, alarm.size) == ("e", "fault", "outliers", None)


def test_a_joint_unlike_its_fleet_is_an_outlier_and_an_unlike_fleet_has_none():
    rng = np.random.default_rng(7)
    levels = dict(zip(JOINTS, 1.0 + 0.02 * rng.normal(size=8), strict=True))
    names = recordings(JOINTS, 1)

    def one(d):
        return history(rng, joints=JOINTS, days=40, course=lambda j, day: d[j] - 1.0 + 0.0 * day)

    assert {a.kind for a in alarms(one(levels), names)} == set()
    assert [(a.joint, a.kind) for a in alarms(one({**levels, "g": 1.4}), names)] == [("g", "outlier")]
    unlike = dict(zip(JOINTS, (1.0, 2.0, 5.0, 0.3, 9.0, 0.1, 20.0, 3.0), strict=True))
    assert alarms(one(unlike), names) == ()


def test_the_key_of_wear_stays_while_its_history_grows():
    made = history(
        np.random.default_rng(8), joints=("a", "b"), days=200,
        course=lambda j, d: -0.1 * np.clip((d - 60) / 100, 0, 1) * (j == "b"),
    )  # fmt: skip
    seen = set()
    for until in range(60, 201, 20):
        part = made["time_s"] < START + DAY * until
        seen |= {a.key for a in alarms({n: c[part] for n, c in made.items()}, recordings(("a", "b"), 1))}
    assert seen == {"b/spring.stiffness/lower/1"}


def test_an_ongoing_change_comes_before_bad_data():
    names = recordings(
        JOINTS, 60, faults=lambda j, d: [{"kind": "outliers"}] if j == "a" and d >= 30 else [],
        causes=lambda j, d: [cause("backlash", 2e-3)] if j == "h" and d >= 30 else [],
    )  # fmt: skip
    assert list(by_joint(alarms(QUIET, names))) == ["h", "a"]


def test_the_false_discovery_rate_is_that_of_benjamini_and_hochberg():
    p = np.array([0.01, 0.04, 0.03, 0.005, 0.8])
    assert adjust(p) == pytest.approx([0.025, 0.05, 0.05, 0.025, 0.8])


@pytest.mark.parametrize("rate", [0.05, 0.01, 1e-5])
def test_the_threshold_of_a_scan_has_its_rate(rate):
    for freedom in (5, 200, 1000):
        assert scan_p(scan_threshold(rate, 0.03, freedom), 0.03, freedom) == pytest.approx(rate, rel=1e-6)


def growing(joint, d, since=20):
    """Return a backlash of 0.1 mrad for each day since some day."""
    size = 1e-4 * (d - since)
    return [cause("backlash", size, doubt=2e-6 / size)] if joint == "c" and d > since else []


def test_the_size_of_a_growing_cause_is_that_of_now():
    """The median of its last nine recordings stood for it: 2.75 mrad with 3.75 in the last."""
    (alarm,) = alarms(QUIET, recordings(JOINTS, 60, causes=growing))
    assert alarm.size.low < 3.9e-3 < alarm.size.high
    assert (alarm.growth, alarm.from_first) == ("growing", False)


def test_the_size_of_a_cause_of_few_days_is_that_of_the_last():
    (alarm,) = alarms(QUIET, recordings(JOINTS, 28, causes=growing))
    assert alarm.size.low < 6e-4 < alarm.size.high and alarm.size.value >= 5.9e-4


def test_a_cause_from_the_first_recording_on_that_grows_later_is_a_second_alarm():
    """It was one alarm, dated to the first recording, and its growth was in no title."""

    def causes(joint, d):
        return [cause("backlash", 1e-3 + 1e-4 * max(0, d - 30), doubt=2e-3)] if joint == "c" else []

    both = {a.kind: a for a in alarms(QUIET, recordings(JOINTS, 60, causes=causes))}
    assert set(both) == {"cause", "trend"}
    assert both["cause"].from_first and both["cause"].growth == "growing"
    assert abs((both["trend"].since_s - START) / DAY - 30.0) <= 3.0
