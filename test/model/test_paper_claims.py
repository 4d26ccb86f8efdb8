"""The paper's numbers beside ours: what agrees, what does not, and every contradiction with its number."""

from __future__ import annotations

import pytest

from rsea_ros.model.paper_claims import claims, last_digit
from rsea_ros.model.paper_findings import clamp_error, findings

CLAIMS = {(c.what, c.how): c for c in claims()}


@pytest.mark.parametrize(("text", "step"), [("3.14", 0.01), ("7", 1.0), ("6.169e-4", 1e-7), ("1e8", 1e8)])
def test_last_printed_digit(text, step):
    assert last_digit(text) == pytest.approx(step)


@pytest.mark.parametrize("what", ["J_m", "b_m", "J_m + J_sc", "b_m + b_s"])
def test_table_2_follows_from_eq_10(what):
    found = [c for c in claims() if c.what == what]
    assert len(found) == 1
    assert found[0].agrees


def test_what_does_not_come_out():
    off = {c.what: round(100 * c.difference, 1) for c in claims() if not c.agrees}
    assert off["gain at rest, as Eq. (4) has it"] == -4.8
    assert off["bandwidth of the prototype"] == 0.6
    assert off["torque the spring carries"] == -13.3
    assert off["K_ld, pendulum"] == -7.4
    assert off["b_m, viscous"] == -85.9


@pytest.mark.parametrize(
    ("where", "number"),
    [
        ("Fig. 8 and Eqs. (5) to (7)", "43.8 Hz"),
        ("Eq. (7)", "112.1 Hz"),
        ("Eq. (10)", "4.8 %"),
        ("Table 2, b_m", "3.2 N·m·s/rad"),
        ("Eq. (9)", "11.5 mm"),
        ("3.2.2, 19 Hz", "19.8 Hz"),
        ("4.1 and Eq. (8)", "130 N·m"),
        ("4.1 and 3.1.2", "33°"),
        ("4.1", "13.1 mm"),
    ],
)
def test_findings_carry_their_number(where, number):
    assert any(f.where == where and number in f.text for f in findings())


def test_the_papers_1e8_is_as_good_as_a_clamp():
    assert clamp_error() < 1e-6
