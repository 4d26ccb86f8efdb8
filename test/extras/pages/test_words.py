"""What a fleet's pages say of a joint: dates, sizes and changes, in words whose numbers are given."""

from __future__ import annotations

import math
from datetime import datetime, timezone
from types import SimpleNamespace as Of

import numpy as np
import pytest

from rsea_extras.pages import words
from rsea_extras.trends.result import Interval

MARCH = datetime(2025, 3, 24, 12, tzinfo=timezone.utc).timestamp()
APRIL = datetime(2025, 4, 2, tzinfo=timezone.utc).timestamp()
STIFFNESS = "spring.stiffness"


@pytest.mark.parametrize(
    ("function", "given", "said"),
    [
        (words.percent, (-0.15,), "−15 %"),
        (words.percent, (0.0996,), "+10 %"),
        (words.percent, (0.0994,), "+9.9 %"),
        (words.percent, (0.00096,), "+0.1 %"),
        (words.percent, (0.00094,), "+0.09 %"),
        (words.percent, (4e-5,), "0 %"),
        (words.amount, (-0.15,), "15 %"),
        (words.amount, (4e-5,), "less than 0.01 %"),
        (words.amount, (0.0,), "0 %"),
        (words.day, (MARCH,), "24 March 2025"),
        (words.subject, ("rotor.reflected_damping",), "Rotor damping, reflected,"),
        (words.subject, (STIFFNESS,), "Spring stiffness"),
        (words.value, (Interval(3.9e-3, 3.82e-3, 3.98e-3), "rad"), "3.900 ± 0.080 mrad"),
        (words.value, (Interval(0.039, 0.0382, 0.0398), "1"), "3.900 ± 0.080 %"),
    ],
)
def test_sizes_and_dates(function, given, said) -> None:
    assert function(*given) == said


def alarm(kind: str = "step", about: str = STIFFNESS, **more: object) -> Of:
    fallen = {"size": Interval(-80.0, -90.0, -70.0), "relative": -0.05, "unit": "N m"}
    since = {"from_first": False, "since_s": MARCH, "earliest_s": MARCH, "latest_s": APRIL}
    return Of(kind=kind, about=about, **({"status": "leading", "growth": ""} | fallen | since | more))


RISEN = {"size": Interval(80.0, 70.0, 90.0), "relative": 0.05}
BACKLASH = {"kind": "cause", "about": "backlash", "size": Interval(4e-3, 3.9e-3, 4.1e-3), "unit": "rad"}
RIVALS = BACKLASH | {"size": None, "status": "one_of", "growth": "growing"}
EVER = BACKLASH | {"from_first": True, "growth": "growing"}


@pytest.mark.parametrize(
    ("made", "short", "long"),
    [
        (alarm(), "Spring stiffness −5.0 %", "Spring stiffness fell by 5.0 % from 24 March 2025 on"),
        (alarm(**RISEN), "Spring stiffness +5.0 %", "Spring stiffness rose by 5.0 % from 24 March 2025 on"),
        (alarm(from_first=True), "Spring stiffness −5.0 %",
         "Spring stiffness fell by 5.0 % from the first recording on"),
        (alarm(relative=math.nan, size=None), "Spring stiffness", None),
        (alarm("trend"), "Spring stiffness −5.0 %",
         "Spring stiffness has been falling since 24 March 2025: −5.0 % so far"),
        (alarm("trend", **RISEN), "Spring stiffness +5.0 %",
         "Spring stiffness has been rising since 24 March 2025: +5.0 % so far"),
        (alarm("outlier"), "Spring stiffness 5.0 % below the fleet",
         "Spring stiffness is 5.0 % below the median of the fleet"),
        (alarm("outlier", **RISEN), "Spring stiffness 5.0 % above the fleet",
         "Spring stiffness is 5.0 % above the median of the fleet"),
        (alarm("fault", "frozen_samples"), "Frozen samples in the data",
         "Frozen samples in the data since 24 March 2025"),
        (alarm(**BACKLASH), "Backlash, 4.00 ± 0.10 mrad",
         "Backlash appeared about 24 March 2025: now 4.00 ± 0.10 mrad"),
        (alarm(**RIVALS), "Backlash or a look-alike",
         "Backlash or a look-alike appeared about 24 March 2025 and is growing"),
        (alarm(**EVER), "Backlash, 4.00 ± 0.10 mrad",
         "Backlash from the first recording on, growing: now 4.00 ± 0.10 mrad"),
    ],
)  # fmt: skip
def test_an_alarm_in_a_few_words_and_in_a_sentence(made, short, long) -> None:
    assert words.about(made) == short
    assert long is None or words.sentence(made) == long


def test_the_doubt_of_a_date_names_the_year_once() -> None:
    assert words.doubt_of_date(alarm()) == "24 Mar to 2 Apr 2025"
    assert words.doubt_of_date(alarm(latest_s=MARCH + 86400.0)) == "24 to 25 Mar 2025"
    assert words.doubt_of_date(alarm(latest_s=MARCH)) == "24 Mar 2025"
    assert words.doubt_of_date(alarm(from_first=True)) == "before 24 Mar 2025"
    assert words.doubt_of_date(alarm(since_s=math.inf)) == ""


def trend(state: str, **more: object) -> Of:
    base = {"series": seen(True, True, False), "silent_since_s": math.nan, "detectable": 15.0}
    course = {"per_year": None, "relative": -0.05, "to_limit_s": None, "changes": ()}
    levels = {"now": Of(value=1500.0), "first": Of(value=1600.0)}
    return Of(state=state, **(base | course | levels | more))


def seen(*identifiable: bool) -> Of:
    return Of(parameter=STIFFNESS, unit="N m/rad", identifiable=np.array(identifiable))


def change(size: float, kind: str = "step") -> Of:
    return Of(size=Of(value=size), since_s=MARCH, kind=kind)


FALLING = {"per_year": Of(value=-3.0), "to_limit_s": Interval(APRIL, MARCH, APRIL)}


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (trend("steady"), " is steady: no step above 15 N·m/rad, 1.0 %"),
        (trend("steady", now=None), " is steady: no step above 15 N·m/rad"),
        (trend("undetermined"), ": intervals too wide"),
        (trend("undetermined", detectable=math.inf), ": too few days"),
        (trend("undetermined", series=seen(True, False)), ": not enough excitation"),
        (trend("trending", per_year=Of(value=2.0)), " is rising: −5.0 % since the first day"),
        (trend("trending", **FALLING), " is falling: −5.0 % since the first day, "
         "at its limit about 2 April 2025 (24 Mar 2025 to 2 Apr 2025)"),
        (trend("changed", changes=(change(-80.0),)), " fell by 5.0 % on 24 March 2025"),
        (trend("changed", changes=(change(160.0, "ramp"),)), " rose by 10 % from 24 March 2025 on"),
        (trend("changed", changes=(change(160.0),), first=None), " rose on 24 March 2025"),
        (trend("steady", now=None, silent_since_s=MARCH),
         " is steady: no step above 15 N·m/rad; cannot be determined since 24 March 2025"),
    ],
)  # fmt: skip
def test_the_title_of_a_parameters_figure_is_its_finding(made, said) -> None:
    assert words.finding(made) == f"Spring stiffness{said}"
