"""The controller over topics: the torque follows, stays within its limits, and ends when measurements do."""

import signal
import time

import numpy as np
import pytest

from msg_adapters.ros import (
    DiagnosticArray,
    JointState,
    Trigger,
    WrenchStamped,
    effort_of,
    stamp_of,
    torque_command_message,
    wrench_of,
)
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

RATE = 280.0
PERIOD = SECOND / RATE
HZ, AMPLITUDE = 5.0, 10.0
LEAD = 0.2


class Loop:
    """Topics of plant and controller as seen from outside."""

    def __init__(self, listener):
        self.listener = listener
        self.states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
        self.wrenches = listener.hear(WrenchStamped, "/rsea/ft", MEASUREMENT)
        self.commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self._desired = listener.node.create_publisher(JointState, "/rsea/desired_torque", COMMAND)

    def ready(self):
        """Wait until the controller commands and all is heard: each topic is discovered at its own time."""
        self.listener.until(lambda: self._desired.get_subscription_count() and len(self.commands) > 100)
        self.listener.until(lambda: self.states and self.wrenches)

    def sine(self, seconds):
        """Publish a sine on the grid of the measurements, ahead of time; return the error, by period."""
        start = stamp_of(self.states[-1].header.stamp) + round(0.3 * RATE) * PERIOD
        wanted = lambda t: AMPLITUDE * np.sin(2 * np.pi * HZ * t)  # noqa: E731
        for k in range(round(seconds * RATE)):
            stamp = round(start + k * PERIOD)
            self.listener.until(lambda stamp=stamp: stamp < time.time_ns() + LEAD * SECOND)
            self._desired.publish(torque_command_message(stamp, wanted(k / RATE)))
        self.listener.until(lambda: stamp_of(self.wrenches[-1].header.stamp) > start + seconds * SECOND)
        read = np.array([wrench_of(m) for m in self.wrenches])
        t = (read[:, 0] - start) / SECOND
        inside = (t > 1.0) & (t < seconds)
        error, period = (read[:, 1] - wanted(t))[inside], np.floor(t[inside] * HZ)
        return [
            np.sqrt(np.mean(error[period == p] ** 2)) / AMPLITUDE * np.sqrt(2.0) for p in np.unique(period)
        ]

    def hold(self, torque, condition):
        """Publish a constant torque until a condition holds."""

        def done():
            self._desired.publish(torque_command_message(time.time_ns(), torque))
            return condition()

        self.listener.until(done)

    def values(self):
        """Key and value of the controller's newest status."""
        mine = [m for m in self.health if m.status[0].name.endswith("controller")]
        return {pair.key: pair.value for pair in mine[-1].status[0].values} | {"": mine[-1].status[0].message}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """A model.yaml with 3 N m of friction in the gear."""
    rig = load_rig("paper_high_impedance").with_effects(EffectSetting("coulomb_friction", {"torque": 3.0}))
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    save_rig(rig, path)
    return path


@pytest.fixture(scope="module")
def loop(start, listener, model):
    """A bench with friction, and a controller that knows it."""
    topics = Loop(listener)
    topics.plant = start("plant", rig=model, rate=RATE)
    topics.controller = start("controller", rig=model, rate=RATE, torque_limit=60.0, stale=0.5)
    topics.ready()
    return topics


def test_a_sine_is_followed_through_friction_that_the_model_has(loop):
    """Without the model's friction no period is below 0.05; a machine that stalls spoils many."""
    errors = loop.sine(3.0)
    while sorted(errors)[2] >= 0.025 and len(errors) < 60:
        errors += loop.sine(3.0)
    assert sorted(errors)[2] < 0.025, errors


def test_a_command_acts_one_sample_after_its_measurement(loop):
    first = stamp_of(loop.states[0].header.stamp)
    cycles = np.array([effort_of(m)[0] - first for m in loop.commands]) / PERIOD
    assert cycles == pytest.approx(np.round(cycles), abs=1e-5)
    assert np.median(np.diff(cycles)) == pytest.approx(1.0, abs=1e-5)
    heard = np.array([stamp_of(m.header.stamp) - first for m in loop.states]) / PERIOD
    assert np.round(cycles[-1]) <= np.round(heard[-1]) + 2


def test_steps_stay_within_the_limit_and_reach_their_value(loop):
    loop.hold(40.0, lambda: abs(wrench_of(loop.wrenches[-1])[1] - 40.0) < 0.5)
    torques = np.array([effort_of(m)[1] for m in loop.commands])
    assert np.abs(torques).max() == pytest.approx(60.0)
    loop.hold(0.0, lambda: abs(wrench_of(loop.wrenches[-1])[1]) < 0.5)


def test_without_measurements_the_torque_ends_until_the_fault_is_cleared(loop, start, model, listener):
    loop.hold(20.0, lambda: abs(wrench_of(loop.wrenches[-1])[1] - 20.0) < 0.5)
    loop.plant.kill()
    listener.until(lambda: "no usable measurement" in loop.values()[""])
    listener.until(lambda: effort_of(loop.commands[-1])[1] == 0.0)
    start("plant", rig=model, rate=RATE)
    seen = len(loop.states)
    loop.hold(20.0, lambda: len(loop.states) > seen + 50)
    assert all(effort_of(m)[1] == 0.0 for m in loop.commands[-20:])
    client = listener.node.create_client(Trigger, "/rsea/controller/clear_fault")
    listener.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    listener.until(answer.done)
    loop.hold(20.0, lambda: abs(wrench_of(loop.wrenches[-1])[1] - 20.0) < 0.5)


def test_at_its_end_the_controller_commands_zero(loop, listener):
    assert loop.controller.stop(signal.SIGTERM) == 0
    listener.until(lambda: effort_of(loop.commands[-1])[1] == 0.0)
