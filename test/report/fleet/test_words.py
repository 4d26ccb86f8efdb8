"""Names, dates and changes as the pages of a fleet write them."""

from __future__ import annotations

import re

import pytest
from fleet_histories import START
from worn_fleet import WORN

from rsea_ros.report.fleet.words import day, doubt_of_date, name, percent
from rsea_ros.trends import alarms


@pytest.mark.parametrize(
    ("share", "text"), [(-0.1512, "−15 %"), (0.021, "+2.1 %"), (-0.00034, "−0.03 %"), (1e-9, "0 %")]
)
def test_changes_are_written_as_people_write_them(share, text):
    assert percent(share) == text


def test_names_and_dates_are_plain():
    assert day(START) == "1 January 2025"
    assert name("coulomb_friction.torque") == "Coulomb friction torque"
    assert name("command_delay.delay") == "Command delay"
    assert name("spring.stiffness") == "Spring stiffness"


def test_the_doubt_of_a_date_says_month_and_year_once(tables):
    (wear,) = (a for a in alarms(*tables) if a.joint == WORN)
    assert re.fullmatch(r"\d+ (\w{3} )?to \d+ \w{3} 2025", doubt_of_date(wear))
