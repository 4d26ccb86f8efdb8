"""Tables without a run in them: static calibrations, and runs without commands."""

from __future__ import annotations

import numpy as np
import pytest

from msg_adapters.tables import load_map, summary
from rsea_ros.errors import ImportMapError

ANGLES = np.r_[np.arange(-20, 21), np.arange(20, -21, -1)] / 1000
RUN = "t,i,q\n" + "".join(f"{k / 100},{np.sin(k / 9):.4f},{np.sin(k / 9) / 50:.6f}\n" for k in range(99))
STATIC = """time: set_points
channels:
  deflection: {column: q, unit: rad}
  command: {column: u, unit: N m}
  ft: {column: f, unit: N m}
"""
MEASURED = """time: {column: t, unit: s}
channels:
  motor_torque: {column: i, unit: N m}
  position: {column: q, unit: rad}
"""


def calibration():
    rng = np.random.default_rng(0)
    rows = (f"{q},{200 * q / 6.8},{198 * q + rng.normal(0, 0.02)}" for q in ANGLES)
    return "q,u,f\n" + "\n".join(rows) + "\n"


def test_a_static_calibration_gives_the_stiffness_with_its_interval(files):
    record = files(STATIC, calibration())
    line = next(note for note in record.notes if note.startswith("ft over deflection"))
    slope, half = line.split(": ")[1].split(" N·m/rad")[0].split(" ± ")
    assert abs(float(slope) - 198) < float(half) < 0.5
    assert any(note.startswith("ft over command: 6.7") for note in record.notes)
    assert set(record.channels) == {"deflection", "ft"}  # no verb may take a second a reading for a run


def test_what_can_be_done_without_a_run_is_told(files, tmp_path):
    for text, rows, said in (
        (STATIC, calibration(), "need the record of a motion"),
        (MEASURED, RUN, "no command: `check` compares the channels"),
    ):
        record = files(text, rows)
        assert said in " ".join(summary(record, load_map(tmp_path / "map.yaml")))


def test_a_map_without_a_time_is_told_what_there_is(files):
    with pytest.raises(ImportMapError, match=r"expected .* or `set_points` for readings"):
        files(STATIC.partition("\n")[2], calibration())
