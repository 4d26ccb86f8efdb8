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
from test.nodes.torque_loop import RATE, Loop

HZ, AMPLITUDE = 10.0, 5.0
DIES, SECONDS = 2.2, 3.0
"""s from the begin of the sine."""
GAINS = {"k_p": 0.2575, "k_d": 0.003029, "k_i": 1.195, "q_frequency": 6.99, "k_w": 42.9}
"""Of the synthesis, which takes 3 s."""


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
def rigs(tmp_path_factory):
    """The bench, free, and what the controller believes: both ends held; both with an encoder."""
    folder = tmp_path_factory.mktemp("rigs")
    for name in ("paper_moving_output", "paper_high_impedance"):
        rig = load_rig(name)
        encoder = {"deflection": Sensor(noise=5e-6)}
        save_rig(replace(rig, sensors={**rig.sensors, **encoder}), folder / f"{name}.yaml")
    return folder


@pytest.fixture(scope="module")
def loop(start, listener, rigs):
    """Plant and controller that run."""
    topics = Loop(listener)
    topics.encoder = Encoder(listener)
    moving, held = (rigs / f"{name}.yaml" for name in ("paper_moving_output", "paper_high_impedance"))
    start("plant", remaps={"deflection": "encoder"}, rig=moving, rate=RATE)
    topics.controller = start("controller", rig=held, rate=RATE, stale=0.5, **GAINS)
    topics.ready()
    listener.until(lambda: len(topics.encoder.angles) > 220)
    return topics


@pytest.fixture(scope="module")
def run(loop):
    """The instant (ns) within a sine at which the encoder died after it had been used."""
    for _ in range(8):
        loop.encoder.alive, link = True, {}
        loop.sine(AMPLITUDE, HZ, SECONDS, lambda t, link=link: follow(loop, t, link))
        if {"before", "at"} <= link.keys() and np.diff(commands(loop, link["at"])[0]).max() < 1.5 / RATE:
            break  # else the machine stalled, for so long perhaps that the controller has a fault
        loop.listener.call("/rsea/controller/clear_fault")
    assert link["before"] == "used"
    return link["at"]


def commands(loop, at):
    """Return time after an instant (s) and torque of each command about it."""
    stamps, torques = np.array([(stamp_of(m.header.stamp), m.effort[0]) for m in loop.commands]).T
    t = (stamps - at) * 1e-9
    about = (t > -1.0) & (t < 0.5)
    return t[about], torques[about]


def follow(loop, t, link):
    """Cut the encoder off in time, and note what the controller says of it before."""
    if t > DIES and loop.encoder.alive:
        loop.encoder.alive = False
        link["at"] = stamp_of(loop.states[-1].header.stamp)
    elif 1.2 < t < DIES and loop.values().get("link") == "used":
        link["before"] = "used"


def test_the_plant_publishes_the_deflection_of_each_state(loop):
    angles = loop.encoder.angles[-200:-10]
    loop.listener.until(lambda: stamp_of(loop.states[-1].header.stamp) > angles[-1][0])
    at = [stamp_of(m.header.stamp) for m in loop.states]
    between = [stamp for stamp in at if angles[0][0] <= stamp <= angles[-1][0]]
    assert [stamp for stamp, _ in angles] == between
    assert np.isfinite([angle for _, angle in angles]).all()


def test_an_encoder_that_dies_makes_no_jump(loop, run):
    """Second differences of the command, which a jump would show in."""
    t, torques = commands(loop, run)
    second = np.abs(np.diff(torques, 2))
    assert second[t[2:] > -0.1].max() < 1.5 * second[t[2:] < -0.1].max()


def test_diagnostics_say_that_the_encoder_died(loop, run):
    """As long as it lasts, beside late commands: told once, it was lost behind those of a stall."""
    loop.listener.until(lambda: loop.values()["link"] == "not used: no deflection")
    told, said = len(loop.health), "without the link's motion: no deflection"
    loop.listener.until(lambda: any(said in m.status[0].message for m in loop.health[told:]))
    assert int(loop.values()["link_losses"]) >= 1
