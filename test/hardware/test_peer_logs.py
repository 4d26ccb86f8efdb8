"""What a simulated bench keeps of what it saw: the newest, and nothing where nobody can ask for it."""

import argparse

import pytest

from rsea_ros.cli.bench import _motors
from rsea_ros.hardware.peer.ft import Misbehaviour
from rsea_ros.hardware.peer.protocol2 import instruction
from rsea_ros.hardware.peer.serial_line import EmulatedBus

READ = bytes((0x63, 0x02, 15, 0))


@pytest.mark.parametrize(("kept", "left"), [(0, 0), (5, 5)])
def test_a_bench_keeps_no_more_than_it_is_asked_to(tmp_path, kept, left):
    """A bench that nobody could ask grew by 3.7 MB a minute."""
    args = argparse.Namespace(
        rig="paper_high_impedance", model=[54024], seed=0, torque_constant=0.0, return_delay=0,
        deflection=False, can=None,
    )
    _, motors = _motors(args, kept)
    bus = EmulatedBus(tmp_path / "tty", motors, Misbehaviour(), kept)
    for now in range(9):
        motors[0].write(now, 604, bytes(2))
        for request in bus._listener.hear(instruction(1, 2, READ)):
            bus._answer(now, request)
    bus.vanish()
    assert (len(motors[0].history), len(bus.sent)) == (left, left)
