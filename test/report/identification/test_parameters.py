"""The table of parameters: which values count as determined, and how an asymmetric interval is shown."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.identification.result import ParameterEstimate
from rsea_ros.report.identification.page import parameter_table
from rsea_ros.report.identification.words import value_text


def estimate(
    value: float, low: float, high: float, share: float = 1.0, name: str = "spring.stiffness"
) -> ParameterEstimate:
    return ParameterEstimate(name, value, "N m/rad", (low, high), 1530.0, 0.3, share)


@pytest.mark.parametrize(
    ("p", "answer"),
    [(estimate(1530.5, 1530.4, 1530.6), "yes"), (estimate(1530.5, 1530.4, 1530.6, 0.7), "in part"),
     (estimate(1530.5, 1530.4, 1530.6, 0.1), "no"), (estimate(350.0, -110.0, 810.0), "no"),
     (estimate(0.03, 0.0, 0.55), "no"), (estimate(200.0, 199.0, 200.0), "no"),
     (estimate(3.0, -np.inf, np.inf), "no"), (estimate(0.01, -0.02, 0.04), "no"),
     (estimate(0.01, -0.02, 0.04, name="torque_ripple.phase"), "yes")],
)  # fmt: skip
def test_a_value_within_its_doubt_or_at_a_bound_is_not_determined(p: ParameterEstimate, answer: str) -> None:
    assert p.determined == answer


@pytest.mark.parametrize(
    ("p", "text"),
    [(estimate(1530.4, 1500.4, 1560.4), "1530 ± 30"),
     (estimate(1391.3449, 1391.2849, 1530.511), "1391 (1391 … 1531)"),
     (estimate(3.467, 2.717, 3.798), "3.467 (2.717 … 3.798)"),
     (estimate(3.0, -np.inf, np.inf), "3.000")],
)  # fmt: skip
def test_a_lopsided_interval_is_shown_by_its_ends(p: ParameterEstimate, text: str) -> None:
    assert "".join(value_text(p)) == text
    assert value_text(p)[1] in parameter_table([p])
