"""Clocks are fitted only where the data require it."""

from dataclasses import replace

import numpy as np
import pytest
from benches import bench, record_bench
from runs import RIG, excited

from rsea_ros.identification.identify import identify
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import rig_to_document
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel
from rsea_ros.report.remark_words import remark_sentences


def with_clock(record, channel, offset, ppm):
    """Return a record whose sensor was read later than stamped, by s at the start and ppm of the time."""
    t = record[channel].t
    stamps = t - offset - 1e-6 * ppm * (t - record["command"].t[0])
    return replace(record, channels={**record.channels, channel: Channel(stamps, record[channel].y)})


def clocks(result):
    """Return the clocks that a fit moved, with their intervals."""
    return {p.name: p for p in result.parameters if p.name.startswith("clock")}


def test_correct_clocks_are_left_alone_and_their_cost_is_reported():
    nominal, true = bench("paper_high_impedance", 1)
    result = identify([record_bench(true, 1, 20.0)], nominal)
    assert clocks(result) == {}
    (note,) = result.clocks
    assert note.code == "clocks_taken_as_right"
    (sentence,) = remark_sentences([note])
    assert "taken as right" in sentence and "times as wide" in sentence
    damping = next(p for p in result.parameters if p.name == "rotor.reflected_damping")
    assert (damping.ci95[1] - damping.ci95[0]) / 2 < 5e-4 * damping.value


@pytest.mark.parametrize(
    ("offset", "ppm", "moved"),
    [(8e-5, 0.0, {"clock.ft"}), (1.5e-4, -90.0, {"clock.ft", "clock_rate.ft"})],
)
def test_a_wrong_clock_is_fitted_with_its_size(offset, ppm, moved):
    nominal, true = bench("paper_high_impedance", 1)
    result = identify([with_clock(record_bench(true, 1, 20.0), "ft", offset, ppm)], nominal)
    assert set(clocks(result)) == moved
    for name, p in clocks(result).items():
        size = ppm if name.startswith("clock_rate") else offset
        assert p.ci95[0] - 0.1 * abs(size) < size < p.ci95[1] + 0.1 * abs(size), name
    assert max(result.times_noise.values()) < 1.05
    sensor = result.rig.sensors["ft"]
    assert (sensor.clock_rate != 0.0) == ("clock_rate.ft" in moved)


def test_a_clock_rate_is_part_of_the_rig():
    _, true = bench("paper_high_impedance", 1)
    record = record_bench(true, 1, 5.0)
    fast = replace(true, sensors={**true.sensors, "ft": Sensor(0.03, 0.0, clock_rate=200.0)})
    assert rig_from_document(rig_to_document(fast)).sensors["ft"].clock_rate == 200.0
    late = simulate(fast, record)["ft"]
    moved = simulate(true, with_clock(record, "ft", 0.0, -200.0))["ft"]
    assert np.abs(late - moved)[:-1].max() < 1e-6
    assert np.abs(late - simulate(true, record)["ft"]).max() > 0.02


SWEEP = {"kind": "chirp", "sensors": 1, "amplitude": 8.0, "noise": 0.0, "low": 0.2, "high": 60.0}


def test_a_drift_that_turns_the_phases_is_fitted():
    """6 ms by the end of a chirp left 6 times the noise and the damping 28.4 for 25.4 N m s/rad."""
    true = RIG.with_values({"rotor.reflected_damping": 25.4, "spring.stiffness": 1480.0})
    record = excited(true, duration=30.0, **SWEEP)
    for n in ("position", "velocity"):
        record = with_clock(record, n, 0.0, -450.0)
    result = identify([record], RIG)
    assert max(result.times_noise.values()) < 1.1
    for n in ("position", "velocity"):
        assert clocks(result)[f"clock_rate.{n}"].value == pytest.approx(-450.0, abs=2.0)
    damping = next(p for p in result.parameters if p.name == "rotor.reflected_damping")
    assert damping.value == pytest.approx(25.4, abs=0.1)


def test_a_damping_that_drifts_is_taken_for_no_clock_that_does():
    """Its lag grows along a line, but a clock's rate explains too little of the misfit."""
    record = excited(RIG.with_effect("damping_drift", relative_change=-0.3), duration=20.0, **SWEEP)
    result = identify([record], RIG)
    assert result.verdict == "misfit"
    assert not [name for name in clocks(result) if name.startswith("clock_rate")]
