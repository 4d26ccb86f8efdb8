"""Alarms are files, each sent once; a week of trouble is one file."""

from __future__ import annotations

import json

import pytest
from fleet_stubs import KNEE, stub_work

from rsea_extras.fleet import alarm_files
from rsea_extras.fleet.engine import Engine
from rsea_extras.fleet.pool import Serial
from rsea_extras.fleet.sources import bags_of
from rsea_extras.trends import Alarm
from rsea_extras.trends.result import Interval

STEP = Alarm("knee/spring.stiffness/down", "knee", "spring.stiffness", "change", 1.7e9, 1.69e9, 1.71e9,
             Interval(-200.0, -250.0, -150.0), "N m/rad", -0.15, 0.99, "ab", "artefacts/knee/ab")  # fmt: skip


@pytest.fixture
def worn(store, folder, monkeypatch):
    """Return a store whose trends show a change of one joint."""
    Engine(store, Serial(), stub_work, lambda step, share: None).run(bags_of([str(folder)], [KNEE]))
    monkeypatch.setattr(alarm_files, "alarms", lambda history, recordings: (STEP,))
    return store


def test_an_alarm_is_sent_once(worn):
    (first,) = alarm_files.write_alarms(worn)
    assert first[1] == "knee: Spring stiffness fell by 15 % from 14 November 2023 on"
    assert alarm_files.write_alarms(worn) == []
    assert [file.name for file in (worn.path / "alarms").iterdir()] == [first[0].name]


def test_an_alarm_has_the_form_that_a_webhook_accepts(worn):
    (first,) = alarm_files.write_alarms(worn)
    body = json.loads(first[0].read_text(encoding="utf-8"))
    (alert,) = body["alerts"]
    assert (body["version"], body["status"], alert["status"]) == ("4", "firing", "firing")
    assert alert["labels"]["joint"] == "knee" and alert["startsAt"].startswith("2023-11-14T")
    assert all(isinstance(text, str) for text in {**alert["labels"], **alert["annotations"]}.values())
