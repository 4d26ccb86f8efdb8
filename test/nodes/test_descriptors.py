"""What ROS is told of a parameter: its range in its own type, what it means and what is expected."""

from __future__ import annotations

import math

import pytest

from rsea_ros.errors import ParameterError
from rsea_ros.nodes import _parameters
from rsea_ros.nodes._parameters import DERIVED, NodeParameter, _descriptor, stated_limits


@pytest.mark.parametrize(
    ("parameter", "about", "expected", "bounds"),
    [
        (NodeParameter("a", 1.0, "s", "N m", 0.0, 2.0), "s, N·m", "a number from 0 to 2 N·m", (0.0, 2.0)),
        (NodeParameter("b", 3, "count", "", 1.0, 9), "count", "a whole number from 1 to 9", (1, 9)),
        (NodeParameter("c", True, "whether"), "whether", "true or false", None),
        (NodeParameter("d", "x", "kind", choices=("x", "y")), "kind", "one of x, y", None),
        (NodeParameter("e", ["x"], "names"), "names", "a list of texts", None),
    ],
)
def test_a_range_is_told_in_the_type_of_its_parameter(monkeypatch, parameter, about, expected, bounds):
    monkeypatch.setattr(_parameters, "parameter_descriptor", lambda *told, fixed: (*told, fixed))
    told = _descriptor(parameter)
    assert told == (about, f"expected {expected}", bounds, True)
    if bounds is not None:
        assert [type(v) for v in told[2]] == [type(parameter.default)] * 2


@pytest.mark.parametrize(("value", "limit"), [(5.0, 5.0), (0.0, math.inf), (DERIVED, None)])
def test_a_limit_of_zero_is_none_but_that_of_the_torque(value, limit):
    assert stated_limits({"slew_limit": value}, ["slew"]) == ({} if limit is None else {"slew": limit})
    torque = stated_limits({"torque_limit": value}, ["torque"])
    assert torque == ({} if limit is None else {"torque": value})
    with pytest.raises(ParameterError, match=r"slew_limit = -2, expected -1 to derive it, or at least 0"):
        stated_limits({"slew_limit": -2.0}, ["slew"])
