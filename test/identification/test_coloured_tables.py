"""Noise or misfit, as tables: each measure against theory, and the decision at each of its limits."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from coloured_cases import RATE, case, white
from scipy.signal import lfilter

from rsea_ros.identification import noise_level as coloured
from rsea_ros.identification.noise_level import is_noise, residual_of


def passes(y, **more):
    return is_noise(case(y, **more), {"ft": np.zeros(len(y))}, "ft")


FINE = {"_lasting_share": 0.0, "_slow": 0.0, "off": 0.0, "_unsteady": 0.0, "_kurtosis": 0.0, "_shared": 0.0}


@pytest.fixture
def measured(monkeypatch):
    """Make every measure of a residual return a given number."""

    def set_to(**values):
        numbers = {**FINE, **values}
        for name in set(numbers) - {"off", "_shared"}:
            monkeypatch.setattr(coloured, name, lambda *rest, value=numbers[name]: value)
        monkeypatch.setattr(coloured, "shape_of", lambda spectra: SimpleNamespace(off=numbers["off"]))
        shares = iter(np.atleast_1d(numbers["_shared"]))
        monkeypatch.setattr(coloured, "_coherent_share", lambda *rest: next(shares))
        count = len(np.atleast_1d(numbers["_shared"]))
        monkeypatch.setattr(coloured, "witnesses", lambda *rest: [white(2000)] * count)

    return set_to


@pytest.mark.parametrize(
    ("values", "noise"),
    [
        ({}, True),
        ({"_lasting_share": 0.1}, True),
        ({"_lasting_share": 0.11}, False),
        ({"_slow": 6.0}, True),
        ({"_slow": 6.1}, False),
        ({"off": 5.0}, True),
        ({"off": 5.1}, False),
        ({"_unsteady": 4.0}, True),
        ({"_unsteady": 4.1}, False),
        ({"_kurtosis": 1.0}, True),
        ({"_kurtosis": 1.1}, False),
        ({"_kurtosis": -1.2}, True),  # flatter than Gaussian
        ({"_shared": [0.19, 0.19]}, True),
        ({"_shared": [0.0, 0.2]}, False),
        ({"_shared": [0.2, 0.0]}, False),
    ],
)
def test_a_residual_that_fails_in_one_point_is_a_misfit(measured, values, noise):
    measured(**values)
    assert passes(white(2000)) is noise


@pytest.mark.parametrize(("size", "noise"), [(1499, False), (1500, True)])
def test_short_records_decide_nothing(measured, size, noise):
    measured()
    assert passes(white(size)) is noise


@pytest.mark.parametrize(("more", "ratio"), [({}, 1.0), ({"ratio": 502.0}, 502.0)])
def test_measures_are_given_the_rate_of_the_channel_and_the_ratio_of_the_gear(
    measured, monkeypatch, more, ratio
):
    measured()
    seen = []
    monkeypatch.setattr(coloured, "_slow", lambda values, rate: seen.append(rate) or 0.0)
    monkeypatch.setattr(coloured, "witnesses", lambda case, outputs, n, ratio: seen.append(ratio) or [])
    y = white(2000)
    assert is_noise(case(y, rate=100.0), {"ft": np.zeros(2000)}, "ft", **more)
    assert seen == pytest.approx([100.0, ratio])


def test_an_empty_residual_is_not_noise(measured):
    measured()
    assert passes(np.zeros(2000)) is False
    assert passes(np.where(np.arange(2000) % 2, 0.0, white(2000))) is True, "some zeros are"


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.97])
@pytest.mark.parametrize("rate", [100.0, 256.0, 1000.0])
def test_noise_of_first_order_passes(memory, rate):
    y = lfilter([1.0], [1.0, -memory], white(9000, seed=3))[1000:]
    assert passes(y, rate=rate)


T = np.arange(8192) / RATE


@pytest.mark.parametrize(
    "misfit",
    [
        0.5 * np.ones(8192),  # an offset
        np.linspace(-1.0, 1.0, 8192),  # a drift
        np.sin(2 * math.pi * 40.0 * T),  # a line
        np.where(np.arange(8192) % 512 == 0, 20.0, 0.0),  # knocks
        np.where(T > 16.0, 2.0, 0.0) * white(8192, seed=8),  # more of it later
        0.8 * np.sin(3.0 * T) ** 3,  # of the command
    ],
)
def test_a_misfit_in_noise_does_not_pass(misfit):
    assert not passes(white(8192, seed=4) + misfit)
    assert passes(white(8192, seed=4))


def test_the_residual_is_measured_less_simulated_and_zero_where_it_does_not_count():
    made = case(np.array([5.0, 7.0, 9.0]), mask=np.array([True, False, True]))
    assert residual_of(made, {"ft": np.array([1.0, 1.0, 2.0])}, "ft").tolist() == [4.0, 0.0, 7.0]
