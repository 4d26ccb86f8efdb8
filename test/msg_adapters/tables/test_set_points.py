"""Tables without a run in them: static calibrations, and runs without commands."""

from __future__ import annotations

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map, summary
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


def imported(folder, content, mapping):
    (folder / "run.csv").write_text(content)
    (folder / "map.yaml").write_text(mapping)
    mapping = load_map(folder / "map.yaml")
    return import_record(folder / "run.csv", mapping), mapping


def calibration():
    rng = np.random.default_rng(0)
    rows = (f"{q},{200 * q / 6.8},{198 * q + rng.normal(0, 0.02)}" for q in ANGLES)
    return "q,u,f\n" + "\n".join(rows) + "\n"


def test_a_static_calibration_gives_the_stiffness_with_its_interval(tmp_path):
    record, _ = imported(tmp_path, calibration(), STATIC)
    line = next(note for note in record.notes if note.startswith("ft over deflection"))
    slope, half = line.split(": ")[1].split(" N·m/rad")[0].split(" ± ")
    assert abs(float(slope) - 198) < float(half) < 0.5
    assert any(note.startswith("ft over command: 6.7") for note in record.notes)
    assert set(record.channels) == {"deflection", "ft"}  # no verb may take a second a reading for a run


def test_what_can_be_done_without_a_run_is_told(tmp_path):
    record, mapping = imported(tmp_path, calibration(), STATIC)
    assert "need the record of a motion" in " ".join(summary(record, mapping))
    record, mapping = imported(tmp_path, RUN, MEASURED)
    assert "no command: `check` compares the channels" in summary(record, mapping)[-1]


def test_a_map_without_a_time_is_told_what_there_is(tmp_path):
    with pytest.raises(ImportMapError, match=r"expected .* or `set_points` for readings"):
        imported(tmp_path, calibration(), STATIC.partition("\n")[2])
