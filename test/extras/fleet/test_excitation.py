"""What a row of a fleet says of a run's excitation and of its faults."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rsea_extras.fleet.analysis import excitation, faults
from rsea_ros.records.record import Channel, Fault, Record

T = np.arange(2000) / 200.0
WAVE = 3.0 * np.sin(2.0 * np.pi * 5.0 * T) - 1.0


def rows(**channels: np.ndarray) -> dict[str, tuple[float, str]]:
    made = excitation(Record({n: Channel(T[: len(y)], y) for n, y in channels.items()}))
    return {row["name"]: (row["value"], row["unit"]) for row in made}


def test_size_band_and_travel_of_a_run() -> None:
    angle = np.where(np.arange(len(T)) == 7, np.nan, 0.2 * WAVE)
    found, five = rows(command=WAVE, position=angle, ft=10.0 * WAVE), pytest.approx(5.0, abs=0.1)
    assert list(found) == ["rms", "peak", "band_low", "band_high", "position_span", "ft_span"]
    assert found["rms"] == (pytest.approx(3.0 / math.sqrt(2.0)), "N m")
    assert found["peak"][0] == pytest.approx(4.0)
    assert found["band_low"] == found["band_high"] == (five, "Hz")
    assert found["position_span"] == (pytest.approx(1.2), "rad")
    assert found["ft_span"] == (pytest.approx(60.0), "N m")


def test_what_a_run_lacks_is_not_said() -> None:
    assert list(rows(reference=WAVE)) == ["rms", "peak"] and rows(reference=WAVE)["rms"][1] == "rad"
    lost = np.where(T > 5.0, np.nan, WAVE)
    assert list(rows(command=lost, ft=np.full(len(T), np.nan))) == ["rms", "peak"]  # no band
    assert rows(command=lost)["peak"][0] == pytest.approx(4.0)
    assert list(rows(command=WAVE[:2])) == ["rms", "peak"] and len(rows(command=WAVE[:3])) == 4
    assert rows(velocity=WAVE) == {}


def test_faults_are_counted_by_kind_with_the_place_of_the_first() -> None:
    listed = [
        Fault("outliers", "ft", 0.0123, "at 3 s"), Fault("clock_jump", "position", 1.0, "", 2.5, "s"),
        Fault("outliers", "position", 0.5), Fault("outliers", "ft", 0.0123, "at 3 s"),
        Fault("missing_topic", "", math.nan),
    ]  # fmt: skip
    assert faults(listed) == [
        {"kind": "clock_jump", "count": 1, "detail": "position: 100 %, 2.5 s"},
        {"kind": "missing_topic", "count": 1, "detail": ""},
        {"kind": "outliers", "count": 2, "detail": "ft: 1.23 %, at 3 s"},
    ]
