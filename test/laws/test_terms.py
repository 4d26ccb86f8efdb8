"""A term is the formula that people read, depends on what it says, and its unit makes a torque of it."""

import re

import numpy as np
import pytest

from rsea_ros.laws.terms import (
    COMMAND_TERMS,
    ENCODER_TERMS,
    GEAR_TERMS,
    LOAD_TERMS,
    MOTOR_TERMS,
    SENSOR_TERMS,
    SPRING_TERMS,
    hum_terms,
    mode_terms,
    wave_terms,
)  # fmt: skip

EVERY = (*GEAR_TERMS, *MOTOR_TERMS, *COMMAND_TERMS, *SPRING_TERMS, *SENSOR_TERMS, *LOAD_TERMS, *ENCODER_TERMS,
         *wave_terms(7.0), *hum_terms(50.0), *mode_terms((20.0, 31.0)))  # fmt: skip
UNITS = {"w": "rad/s", "q": "rad", "h": "rad", "theta": "rad", "d": "rad", "T": "N m", "u": "N m", "t": "s",
         "share": "1"}  # fmt: skip
WORDS = {"w": "speed", "T": "load", "u": "command", "q": "position", "d": "deflection", "share": "time"}
SPELLED = (
    (r"\b(lag|mode|h|z|play)\([^()]*\)|u\(t - \{a\}\)", "m"), (r"\|([^|]*)\|", r"abs(\1)"),
    ("clip", "around"), ("±", ""), ("T_s", "T"), ("T_m", "u"), (r"\{a\}", "a"), ("t/duration", "share"),
    ("·", "*"), ("²", "**2"), ("³", "**3"), ("⁵", "**5"), ("2π", "2*pi"), ("ω", "w"),
    ("θ", "theta"), ("φ", "h"), (r"u where (.*)", r"u * (\1)"),
)  # fmt: skip
FUNCTIONS = {"abs": abs, "max": np.maximum, "pi": np.pi, "around": lambda x, a: np.clip(x, -a, a),
             **{f.__name__: f for f in (np.sin, np.cos, np.tanh, np.exp, np.sign)}}  # fmt: skip
FUNCTIONS["min"] = np.minimum


def variables():
    """Return values of both signs, none near 0 where a gear creeps."""
    rng = np.random.default_rng(1)
    signed = {name: rng.uniform(0.1, 2.0, 60) * rng.choice([-1.0, 1.0], 60) for name in (*UNITS, "m")}
    return signed | {name: np.abs(signed[name]) for name in ("t", "share")}


def size(unit, **scales):
    """Return how many times as large a number is, where the units are so many times as small."""
    text = unit.replace("N m", "N").replace(" ", "*").replace("^", "**")
    return float(eval(text, scales | {"Hz": 1.0 / scales["s"]}))


@pytest.mark.parametrize("term", EVERY, ids=lambda t: f"{t.place}-{t.name}")
def test_a_term_is_its_formula_in_the_units_of_its_place(term):
    at, shape = variables(), 0.61
    at["u"][np.abs(at["u"] / shape - 0.99) < 0.011] = 2.0  # a band ends within 2 % of its width
    text = term.equation
    for pattern, word in SPELLED:
        text = re.sub(pattern, word, text)
    read = eval(text, {**FUNCTIONS, **at, "a": shape}) * (-1.0 if term.friction else 1.0)
    values = term.values(at, shape)
    np.testing.assert_allclose(values, np.broadcast_to(read, 60), rtol=1e-12)

    kept = {"dahl": "1", "heat": "(N m)^2"}.get(term.memory, UNITS.get(term.remembers, "1"))
    turns = re.search("sin|cos", term.expression)
    for name in ("N", "s") if turns else ("N", "s", "rad"):
        scales = dict.fromkeys(("N", "s", "rad"), 1.0) | {name: 3.0}
        other = {k: at[k] * size(unit, **scales) for k, unit in (UNITS | {"m": kept}).items()}
        found = term.values(other, shape * size(term.shape_unit or "1", **scales)) * size(term.unit, **scales)
        whole = size("rad" if term.place == "encoder" else "N m", **scales)
        np.testing.assert_allclose(found, values * whole, rtol=1e-9, err_msg=f"{term.unit}, {name}")


FREE = {"drift_drag", "drift_friction", "spread_friction", "wide_friction"}
"""They take energy, but are what a drag has more at one time or place than at another."""


@pytest.mark.parametrize("term", GEAR_TERMS, ids=lambda t: t.name)
def test_a_drag_takes_energy_whatever_the_signs_and_says_what_it_depends_on(term):
    at = variables()
    assert bool(term.memory) == ("past" in term.regressor)
    if not term.memory:
        takes = bool(np.all(term.values(at, 0.3) * at["w"] <= 0.0))
        assert takes == (term.is_drag or term.name in FREE)
        letters = set(re.findall(r"[a-zA-Z]+", term.expression)) | ({"w"} if term.friction else set())
        words = [word for letter, word in WORDS.items() if letter in letters]
        assert set(term.regressor.split(" and ")) == set(words or ["a constant"])
    assert bool(term.shape) == bool(term.shape_unit) == bool(term.shapes)
    assert sorted({*term.shapes, 0.0, 1.0}) == [0.0, *term.shapes, 1.0] or not term.over, "shares of a size"
