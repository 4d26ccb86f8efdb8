"""Plant and controller with an encoder on the spring: it is used, and it may die.

The encoder's topic passes through this process, so that it can be cut off while everything else goes on.
"""

from dataclasses import replace

import numpy as np
import pytest

from msg_adapters.ros import JointState, stamp_of
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._qos import MEASURED, MEASUREMENT
from test.nodes.torque_loop import GAINS, RATE, Loop

HZ, AMPLITUDE = 10.0, 5.0


class Encoder:
    """The encoder's topic on its way from plant to controller."""

    def __init__(self, listener):
        self.alive, self.angles = True, []
        self._publisher = listener.node.create_publisher(JointState, "/rsea/deflection", MEASURED)
        listener.node.create_subscription(JointState, "/rsea/encoder", self._pass_on, MEASUREMENT)

    def _pass_on(self, message):
        self.angles.append((stamp_of(message.header.stamp), message.position[0]))
        if self.alive:
            self._publisher.publish(message)


@pytest.fixture(scope="module")
def loop(start, listener, tmp_path_factory):
    """Plant and controller of one rig: ft jumps beside the spring of a free load that is said to be held."""
    rig, path = load_rig("paper_high_impedance"), tmp_path_factory.mktemp("rig") / "held.yaml"
    save_rig(replace(rig, sensors={**rig.sensors, "deflection": Sensor(noise=5e-6)}), path)
    topics = Loop(listener)
    topics.encoder = Encoder(listener)
    start("plant", remaps={"deflection": "encoder"}, rig=path, rate=RATE)
    topics.controller = start("controller", rig=path, rate=RATE, stale=0.5, **GAINS)
    topics.ready()
    listener.until(lambda: len(topics.encoder.angles) > 220)
    return topics


def test_the_plant_publishes_the_deflection_of_each_state(loop):
    angles = loop.encoder.angles[-200:-10]
    loop.listener.until(lambda: stamp_of(loop.states[-1].header.stamp) > angles[-1][0])
    at = [stamp_of(m.header.stamp) for m in loop.states]
    between = [stamp for stamp in at if angles[0][0] <= stamp <= angles[-1][0]]
    unpaired = {stamp for stamp, _ in angles}.symmetric_difference(between)
    assert len(unpaired) < 0.1 * len(angles)  # a busy machine loses some of either
    assert np.isfinite([angle for _, angle in angles]).all()


def test_a_sound_encoder_is_used_and_its_death_is_shown(loop):
    """As long as it lasts, beside late commands: told once, it was lost behind those of a stall."""
    shown, said = set(), "without the link's motion: no deflection"
    for _ in range(40):  # the encoder goes through this process, late where the machine is busy
        loop.sine(AMPLITUDE, HZ, 1.5, lambda t: shown.add(loop.values().get("link")))
        if "used" in shown:
            break
    assert "used" in shown, loop.values()
    loop.encoder.alive = False
    loop.listener.until(lambda: loop.values()["link"] == "not used: no deflection")
    told = len(loop.health)
    loop.listener.until(lambda: any(said in m.status[0].message for m in loop.health[told:]))
    assert int(loop.values()["link_losses"]) >= 1
