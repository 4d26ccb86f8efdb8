"""An effect that explains the data is not lost before it is fitted, however poor its first guess.

On the second bench, with only this effect in the catalogue: such effects were lost even without rivals.
"""

from __future__ import annotations

import numpy as np
import pytest
from independent.bench import drawn_bench, record_command
from independent.hidden import hide

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.model.rig_file import load_rig

RATE, DURATION = 280.0, 20.0


def slow_sweep(rng):
    """30 N m from 0.1 to 10 Hz."""
    t = np.arange(round(DURATION * RATE)) / RATE
    growth = np.log(100.0) / DURATION
    return 30.0 * np.sin(2.0 * np.pi * 0.1 * np.expm1(growth * t) / growth)


def steps(rng):
    """Levels up to 30 N m, each for 0.2 to 1.2 s."""
    lengths = rng.integers(round(0.2 * RATE), round(1.2 * RATE), 100)
    return np.repeat(rng.uniform(-30.0, 30.0, 100), lengths)[: round(DURATION * RATE)]


@pytest.mark.parametrize(
    ("name", "parameters", "command"),
    [
        ("damping_drift", {"relative_change": -0.09}, slow_sweep),
        ("load_dependent_friction", {"coefficient": 0.018}, steps),
        (
            "structural_resonance",
            {"frequency": 29.0, "damping_ratio": 0.026, "participation": 0.51},
            slow_sweep,
        ),
    ],
)
def test_a_guess_far_too_large_does_not_lose_the_effect(name, parameters, command):
    """Two linear steps from a typical size left more residual than no effect, and the effect was dropped."""
    rng = np.random.default_rng(5)
    record = record_command(hide(drawn_bench(rng), name, parameters), command(rng), rng)
    others = tuple(other for other in catalogue() if other != name)
    diagnosis = diagnose(
        [record], load_rig("paper_high_impedance"), settings=DiagnosisSettings(without=others)
    )
    assert [cause.name for cause in diagnosis.causes] == [name]
    assert diagnosis.verdict == "explained"


@pytest.mark.parametrize(
    ("name", "parameters", "command"),
    [
        ("hard_stop", {"angle": 0.0135, "stiffness": 3900.0}, slow_sweep),
        ("base_compliance", {"stiffness": 9080.0, "inertia": 1.13}, slow_sweep),
    ],
)
def test_the_better_of_two_guesses_shows_after_a_fit(name, parameters, command):
    """The guess that was best after two steps ended in another minimum, and a look-alike won or none."""
    rng = np.random.default_rng(5)
    record = record_command(hide(drawn_bench(rng), name, parameters), command(rng), rng)
    tried = (name, *effect_named(name).claims.confusable_with, "command_delay")
    others = tuple(other for other in catalogue() if other not in tried)
    settings = DiagnosisSettings(without=others)
    diagnosis = diagnose([record], load_rig("paper_high_impedance"), settings=settings)
    assert [cause.name for cause in diagnosis.causes] == [name]
    assert diagnosis.verdict == "explained"
