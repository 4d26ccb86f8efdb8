"""A cause whose size is open is not confirmed: a law that may be any size bends to whatever is left."""

from __future__ import annotations

import pytest

from rsea_ros.diagnosis.naming import conclusion as outcome
from rsea_ros.diagnosis.naming.conclusion import is_known, sizes
from rsea_ros.diagnosis.naming.status import Named
from rsea_ros.diagnosis.result import CauseParameter
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.result import ParameterEstimate


@pytest.mark.parametrize(
    ("low", "high", "known"),
    [
        (3.9e-3, 4.1e-3, True),
        (1.0, 9.9, True),
        (1.0, 10.1, False),
        (500.0, 108_893.0, False),  # a base that was not there, beside backlash and friction
        (-0.2, -0.1, True),  # a drift downwards
        (-0.2, 0.1, False),
        (0.0, 1.0, False),
    ],
)
def test_a_size_is_known_that_has_a_sign_and_less_than_a_factor_of_ten(low, high, known):
    assert is_known(CauseParameter(0.5 * (low + high), "N m", (low, high)), DEFAULT.sizes) == known


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "ci95", "begin"),
    [
        ("torque_constant_drift", "time_constant", 1e5, (0.3, 1e5), 0.0),  # it was -0.9 s
        ("command_delay", "delay", 4e-6, (2e-6, 6e-6), 0.0),
        ("torque_constant_drift", "relative_change", 0.01, (-0.02, 0.04), -0.02),
    ],
)
def test_the_models_error_leads_no_interval_below_zero(effect, parameter, value, ci95, begin):
    unit = "s" if begin == 0.0 else "1"
    estimate = ParameterEstimate(f"{effect}.{parameter}", value, unit, ci95, value, 1.0, 1.0)
    ((name, size),) = sizes(effect, [estimate], DEFAULT.sizes).items()
    assert name == parameter and size.statistical_ci95 == ci95
    assert size.ci95[0] == pytest.approx(begin, rel=1e-3, abs=0.0)
    assert size.ci95[1] >= ci95[1]


class Stage:
    """The part of an evaluated model that the naming reads."""

    def __init__(self, added):
        self.added = added


@pytest.mark.parametrize(
    ("status", "interval", "after"),
    [
        ("confirmed", (1.0, 2.0), "confirmed"),
        ("confirmed", (1.0, 20.0), "leading"),
        ("one_of", (1.0, 20.0), "one_of"),
        ("leading", (1.0, 20.0), "leading"),
    ],
)
def test_a_cause_of_open_size_leads_at_most(monkeypatch, status, interval, after):
    monkeypatch.setattr(outcome, "size_of", lambda *_: CauseParameter(1.5, "N m", interval))
    naming = {"coulomb_friction": Named(None, 0.99, status, ()), "backlash": Named(None, 0.1, None, ())}
    stages = [Stage(""), Stage("backlash"), Stage("coulomb_friction")]
    named = outcome.with_sizes_known(naming, stages, DEFAULT)
    assert {name: n.status for name, n in named.items()} == {"coulomb_friction": after, "backlash": None}
    assert named["coulomb_friction"].probability == 0.99
