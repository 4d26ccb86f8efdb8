"""A rigid drive is judged on an even grid, and its record may have fewer samples than that grid."""

from __future__ import annotations

import numpy as np

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel
from rsea_ros.report.diagnosis.page import diagnosis_report


def test_the_page_of_a_rigid_drive_whose_log_lost_samples_is_written():
    """The search took minutes, then the page died: samples of the log were counted on the grid."""
    rng, rig = np.random.default_rng(3), load_rig("bare_drive")
    run = simulate(rig, np.convolve(2.0 * rng.standard_normal(1200), np.ones(8) / 3.0, "same"), rate=100.0)
    kept = np.sort(rng.choice(1199, 1080, replace=False))
    lossy = run.with_channels(**{n: Channel(c.t[kept], c.y[kept]) for n, c in run.channels.items()})
    diagnosis = diagnose([lossy], rig)
    assert {f.kind for f in diagnosis.faults} == {"dropped_samples"}
    assert diagnosis.before[0].t.shape == diagnosis.masked["motor_torque"].shape
    assert "motor torque" in diagnosis_report(diagnosis)
