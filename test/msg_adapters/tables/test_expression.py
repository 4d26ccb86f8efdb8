"""Expressions in a map: values worked out by hand, and text that must never be evaluated."""

import time

import numpy as np
import pytest

from msg_adapters.tables.expression import parse
from rsea_ros.errors import ImportMapError

T = np.linspace(0.0, 1.0, 101)
COLUMNS = {"a": T**2, "b": np.sin(9.0 * T), "tau [Nm]": 2.0 * T}


def value(text):
    return parse(text).values(COLUMNS, T)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a + 2 * b", T**2 + 2.0 * np.sin(9.0 * T)),
        ("-a ** 2 / 4", -(T**4) / 4.0),
        ("a * b", T**2 * np.sin(9.0 * T)),
        ('column("tau [Nm]") * 3', 6.0 * T),
        ("clip(b, -0.5, 0.5)", np.clip(np.sin(9.0 * T), -0.5, 0.5)),
        ("maximum(a, b) - minimum(a, b)", np.abs(T**2 - np.sin(9.0 * T))),
        ("a - first(a) + mean(a)", T**2 + np.mean(T**2)),
        ("atan2(b, sqrt(1 - b ** 2))", np.arcsin(np.clip(np.sin(9.0 * T), -1, 1))),
    ],
)
def test_expressions_have_their_values(text, expected):
    np.testing.assert_allclose(value(text), expected, atol=1e-9)


def test_derivative_and_integral_are_by_the_stamps():
    np.testing.assert_allclose(value("derivative(a)")[1:-1], 2.0 * T[1:-1], atol=1e-12)
    np.testing.assert_allclose(value("integral(a)"), T**3 / 3.0, atol=1e-4)


def test_a_hole_stays_a_hole():
    columns = {**COLUMNS, "a": np.where(T == 0.5, np.nan, COLUMNS["a"])}
    assert np.isnan(parse("2 * a + b").values(columns, T)).sum() == 1


HOSTILE = [
    "__import__('os').system('true')", "a.__class__", "a.tofile('x')", "open('/etc/passwd')", "(lambda: a)()",
    "[x for x in a]", "{a}", "a[0]", "a if b else a", "a and b", "a < b", "f'{a}'", "a := 3", "print(a)",
    "eval('a')", "getattr(a, 'dtype')", "globals()", "a.T", "*a", "abs(*a)", "abs(x=a)", "abs(abs)",
    "clip(a)", "column(a)", "column('a', 'b')", "column('a').x", "a @ b", "a // b", "a % b", "a << 3", "~a",
    "not a", "a;b", "import os", "a = 3", "'a' * 999", "b'a' + a", "1j * a", "True + a", "None", "...", "3",
    "1e999 * a", "", "a" * 2000, "+".join(["a"] * 150), "(" * 300 + "a" + ")" * 300, "-" * 900 + "a", "a(b)",
    "column", "sin",
]  # fmt: skip


def test_text_that_is_not_arithmetic_is_refused_before_it_is_evaluated():
    for text in HOSTILE:
        with pytest.raises(ValueError, match=r"^(has|is|calls) ") as error:
            parse(text)
        assert "\n" not in str(error.value), text
        assert len(str(error.value)) < 300, text


@pytest.mark.parametrize(
    "text",
    ["a * 9**9**9", "9999**9999**9999 * a", "1 / a", "exp(exp(exp(10 * a + 9)))", "(a + 2) ** 20000",
     "(-8)**(1/3) * b", "sqrt(b - 2)", "log(-1 - a)", "0 * (1 / a)"],
)  # fmt: skip
def test_what_is_no_real_finite_number_is_refused(text):
    """An imaginary part was dropped in silence, and an overflow gave a bare exception name."""
    began = time.process_time()
    with pytest.raises(ValueError, match=r"(no real number|is -?inf) at sample \d+"):
        value(text)
    assert time.process_time() - began < 1.0


MAP = """
time: {{expression: "s + 1e-9 * ns", unit: s}}
channels:
  velocity: {{expression: "{}", unit: deg/s}}
  command: {{column: i, unit: N m}}
"""


ROWS = "s,ns,phi,i\n" + "".join(f"{k // 4},{k % 4 * 250_000_000},{k * k},{k}\n" for k in range(9))


def test_a_map_may_have_expressions(files):
    record = files(MAP.format("derivative(phi)"), ROWS)
    assert np.allclose(record["command"].t, np.arange(9) * 0.25)
    assert np.allclose(record["velocity"].y[1:-1], np.radians(8.0 * np.arange(1, 8)))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("derivative(psi)", "run.csv: no column 'psi', expected one of s, ns, phi, i"),
        ("derivation(phi)", "line 4: channels.velocity.expression calls derivation, .* mean derivative"),
        ("phi.real", "channels.velocity.expression has 'phi.real', expected columns"),
        ("1 / (i - i)", "run.csv: '1 / .i - i.' is inf at sample 1, expected a finite number"),
    ],
)
def test_mistakes_are_named_with_file_and_field(files, text, message):
    with pytest.raises(ImportMapError, match=message):
        files(MAP.format(text), ROWS)
