"""The bench of the moving-output test; how the models fare on it stands in test/cli/test_paper.py."""

from __future__ import annotations

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import draw


def test_the_bench_differs_from_what_the_rig_states():
    rig = load_rig("paper_moving_output")
    bench = draw(rig, 1)
    assert all(bench[n] != rig[n] for n in rig.free())
    assert all(bench[n] == rig[n] for n in rig.known)


def test_the_pendulum_is_on_the_distal_end():
    """Distal and proximal were exchanged against section 3.2.2: "(distal link) was left free to rotate"."""
    rig = load_rig("paper_moving_output")
    assert rig.clamped == {"spring_end"} and rig["housing_end.stiffness"] > 0.0
    distal, moving = outputs.distal(rig), outputs.end_torque(rig, "housing_end")
    assert np.array_equal(distal.c, moving.c) and np.array_equal(distal.d, moving.d)
