"""What the data determine is said of the values together with the causes, not of those before them."""

from pathlib import Path

import numpy as np
import pytest
from runs import RATE, trying

import rsea_ros as rsea
from rsea_ros.report.diagnosis.page import diagnosis_json

SECONDS = 8.0
TEMPLATE = Path(__file__).resolve().parents[2] / "config" / "templates" / "rig.yaml"


@pytest.fixture(scope="module")
def diagnosed():
    """A new user's rig: the chassis inertia is a guess, four times too small, and the bench has backlash."""
    rig = rsea.load_rig(TEMPLATE)
    t = np.arange(round(RATE * SECONDS)) / RATE
    chirp = np.sin(2.0 * np.pi * (0.2 * t + 29.8 / (2.0 * SECONDS) * t**2))
    command = 10.0 * chirp + 2.0 * np.random.default_rng(0).standard_normal(len(t))
    true = rig.with_values({"chassis.inertia": 4e-3}).with_effect("backlash", gap=6e-3)
    settings = trying("backlash")
    return rsea.diagnose(rsea.simulate(true, command, RATE), rig, settings=settings)


def test_the_cause_is_confirmed_though_the_chassis_was_a_guess(diagnosed):
    assert [(cause.name, cause.status) for cause in diagnosed.causes] == [("backlash", "confirmed")]
    assert diagnosed.verdict == "explained"


def test_a_value_that_only_the_extended_model_determines_is_called_determined(diagnosed):
    """It was 0.0040 +- 0.0000 and "not identifiable from these data" on one page."""
    before, after = (
        {p.name: p for p in values}["chassis.inertia"]
        for values in (diagnosed.result.baseline, diagnosed.result.final)
    )
    assert (before.determined, after.determined) == ("no", "yes")
    assert after.value == pytest.approx(4e-3, rel=0.02)
    assert "not identifiable" not in diagnosed.summary()
    document = diagnosis_json(diagnosed.result)
    final = document["extended"]["parameters"]["chassis.inertia"]
    assert final["told_by_data"] > 0.9 > document["baseline"]["parameters"]["chassis.inertia"]["told_by_data"]
