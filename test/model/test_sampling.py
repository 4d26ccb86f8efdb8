"""Simulated channels between the ends of steps: exact where cubics are, and at the ends as they are."""

from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.model.simulation import sample

STEPS = 40
ENDS = np.arange(STEPS + 1.0)


def test_at_the_end_of_a_step_a_channel_is_exact():
    values = np.random.default_rng(1).standard_normal(STEPS + 1)
    command = np.repeat(np.random.default_rng(2).standard_normal(STEPS // 4), 4)
    for name in ("position", "velocity", "ft"):
        assert np.array_equal(sample(name, values, ENDS, command), values)


def test_between_steps_of_one_command_a_cubic_is_exact():
    def cubic(t):
        return 0.3 - 0.2 * t + 0.01 * t**2 - 2e-3 * t**3

    at = np.linspace(0.0, STEPS, 777)
    assert sample("position", cubic(ENDS), at, np.ones(STEPS)) == pytest.approx(cubic(at), abs=1e-11)


@pytest.mark.parametrize("after", [0.25, 1.5, 3.75])
def test_a_kink_where_the_command_jumps_is_not_smoothed(after):
    """A velocity that rises before the jump and falls behind it: no point from the other side counts."""
    jump = STEPS // 2
    values = np.where(jump >= ENDS, ENDS, 2.0 * jump - ENDS)
    command = np.where(np.arange(STEPS) < jump, 1.0, -1.0)
    at = np.array([jump - after, jump + after])
    assert sample("velocity", values, at, command) == pytest.approx(jump - after, abs=1e-12)


def test_beyond_its_ends_a_channel_keeps_its_end_values():
    values = ENDS**2
    beyond = sample("ft", values, np.array([-3.0, STEPS + 3.0]), np.ones(STEPS))
    assert np.array_equal(beyond, [0.0, STEPS**2])


def test_a_sensor_that_is_known_to_be_late_shows_what_was(tmp_path):
    """A delay of one period is the sample before, through a file and back; one below zero is refused."""
    rig = rsea.load_rig("paper_high_impedance")
    late = replace(rig, sensors={**rig.sensors, "ft": replace(rig.sensors["ft"], delay=1.0 / 280.0)})
    rsea.save(late, tmp_path / "late.yaml")
    command = 15.0 * np.random.default_rng(0).standard_normal(280)
    now = rsea.simulate(rig, command, 280.0, noise=False)["ft"].y
    before = rsea.simulate(tmp_path / "late.yaml", command, 280.0, noise=False)["ft"].y
    assert before[1:] == pytest.approx(now[:-1], abs=1e-6 * np.abs(now).max())
    text = (tmp_path / "late.yaml").read_text().replace("value: 0.0035", "value: -0.0035")
    (tmp_path / "early.yaml").write_text(text)
    with pytest.raises(rsea.RseaError, match=r"sensors\.ft\.delay\.value = -0\.0035.*expected 0 or more"):
        rsea.load_rig(tmp_path / "early.yaml")
