"""The moving-output test through bags: the unlumped model holds on data held out, the lumped does not."""

from __future__ import annotations

import pytest

from msg_adapters import read_record, write_record
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.moving_output import drawn, moving_output

RIGS = {
    "paper_moving_output": ("ft",),
    "two_moving_outputs": ("ft", "position"),
    "separate_stiffnesses": ("ft", "position"),
}


@pytest.fixture(scope="module", params=RIGS)
def test(request, tmp_path_factory):
    """Run one test of 24 s, every record written to a bag and read back."""
    folder = tmp_path_factory.mktemp("bags")

    def bag(name, record):
        write_record(record, folder / f"{name}.mcap")
        return read_record([folder / f"{name}.mcap"])

    return moving_output(load_rig(request.param), bag, duration=24.0, channels=RIGS[request.param])


def test_the_unlumped_model_explains_the_held_out_torque_at_every_sensor(test):
    unlumped = test.rivals[0]
    assert unlumped.name == "unlumped"
    assert all(j.explained > 0.95 for j in unlumped.judged)


def test_the_lumped_model_fails_at_one_sensor_at_least(test):
    lumped = test.rivals[1]
    assert lumped.name == "lumped"
    assert min(j.explained for j in lumped.judged) < 0.5


def test_the_bench_differs_from_what_the_rig_states():
    rig = load_rig("paper_moving_output")
    bench = drawn(rig, 1)
    assert all(bench[n] != rig[n] for n in rig.free())
    assert all(bench[n] == rig[n] for n in rig.known)
