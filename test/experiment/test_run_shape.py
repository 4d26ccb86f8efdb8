"""Runs begin and end at rest, keep a slew limit, have a low crest factor, and survive their files."""

import numpy as np
import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.experiment.run_shape import (
    KINDS,
    LEAD,
    RunLimits,
    Shape,
    command_of,
    largest_share,
    limits_from,
    of_command,
    read_run,
    run_text,
)

RATE = 280.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slew", [np.inf, 400.0])
def test_a_run_begins_and_ends_at_rest_and_keeps_its_slew(kind, slew):
    command = command_of(Shape(kind, 10.0, bias=2.0), 2.0, RATE, slew)
    asked = of_command(command, RATE)
    assert not command[: round(LEAD * RATE)].any() and command[-1] == 0.0
    assert 1.0 < asked["torque"] <= 12.0 + 1e-9
    assert asked["slew"] <= slew * (1.0 + 1e-6)


def test_the_multisine_has_a_low_crest():
    run = np.trim_zeros(command_of(Shape("multisine", 1.0, low=0.5, high=60.0), 4.0, RATE))
    middle = run[100:-100]
    assert np.max(np.abs(middle)) / middle.std() < 2.2  # a random multisine has about 3.5


def test_a_run_survives_its_file(tmp_path):
    command = command_of(Shape("steps", 5.0), 1.0, RATE)
    (tmp_path / "run.csv").write_text(run_text(command, RATE))
    again, rate = read_run(tmp_path / "run.csv")
    assert again == pytest.approx(command, abs=1e-8) and rate == pytest.approx(RATE)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,torque\n0,1\n", "expected t,command"),
        ("t,command\n0,1\n", "10 lines or more"),
        ("t,command\n" + "".join(f"{k * k},0\n" for k in range(20)), "an even rate"),
        ("t,command\n0,one\n", "two numbers a line"),
    ],
)
def test_a_file_of_another_form_is_refused(tmp_path, text, message):
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(ParameterError, match=message):
        read_run(tmp_path / "run.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("velocity=1", "no torque"),
        ("torque=ten", "expected a number in N·m"),
        ("torque=1,torque=2", "given twice"),
        ("torque=1,speed=2", "expected one of torque"),
        ("torque=-1", "expected > 0"),
    ],
)
def test_senseless_limits_are_refused(text, message):
    with pytest.raises(ParameterError, match=message):
        limits_from(text)


def test_the_largest_share_counts():
    assert largest_share({"torque": 5.0, "velocity": 3.0}, RunLimits(torque=10.0, velocity=2.0)) == 1.5
    assert largest_share({"torque": 5.0, "travel": np.nan}, RunLimits(torque=10.0, travel=1.0)) == np.inf
