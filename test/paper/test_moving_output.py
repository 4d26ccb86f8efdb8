"""The bench of the moving-output test; how the models fare on it stands in test/cli/test_paper.py."""

from __future__ import annotations

from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.moving_output import draw


def test_the_bench_differs_from_what_the_rig_states():
    rig = load_rig("paper_moving_output")
    bench = draw(rig, 1)
    assert all(bench[n] != rig[n] for n in rig.free())
    assert all(bench[n] == rig[n] for n in rig.known)
