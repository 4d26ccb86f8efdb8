"""The controller over topics: the torque follows, stays within its limits, and ends when measurements do."""

import signal
import time

import numpy as np
import pytest

from msg_adapters.ros import JointState, stamp_of, torque_command_message
from rsea_ros.control.following import closed_loop
from rsea_ros.control.link import LinkShare
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._control import TABLE, controller_of, design_of, with_limits
from rsea_ros.nodes._qos import COMMAND
from test.nodes.torque_loop import GAINS, PERIOD, RATE, RISE, SETTLED, Loop

HZ, AMPLITUDE = 5.0, 10.0


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
    topics.controller = start("controller", rig=model, rate=RATE, torque_limit=60.0, stale=0.5, **GAINS)
    topics.ready()
    return topics


@pytest.mark.parametrize(("rig", "begins"), [("model", 0.048), ("paper_high_impedance", 0.065)])
def test_a_sine_is_followed_through_friction_from_its_first_period_where_the_model_has_it(rig, begins, model):
    """Step by step, by a controller as the node's parameters make it. From then on its observer knows."""
    values = {p.name: p.default for p in TABLE} | GAINS | {"rate": RATE}
    values = with_limits(values | {"rig": model if rig == "model" else rig})
    t = np.arange(round(2.0 * RATE)) / RATE
    wanted = AMPLITUDE * np.minimum(1.0, t / RISE) * np.sin(2.0 * np.pi * HZ * t)
    run = closed_loop(load_rig(model), RATE, controller_of(values, design_of(values), LinkShare()), wanted)
    first = (run.ft - wanted)[t < 1.0 / HZ]
    assert np.sqrt(2.0 * np.mean(first**2)) / AMPLITUDE == pytest.approx(begins, rel=0.05)
    assert run.error(SETTLED) < 0.012


def test_a_sine_on_topics_is_followed_without_another_sample_of_delay(loop):
    """One sample late is 0.11 off; a machine that stalls spoils many periods."""
    errors = []
    while min(errors, default=1.0) >= 0.05 and len(errors) < 60:
        errors += loop.sine(AMPLITUDE, HZ, 1.6)
    assert min(errors) < 0.05, errors


def test_a_command_acts_one_sample_after_its_measurement(loop):
    first = stamp_of(loop.states[0].header.stamp)
    cycles = np.array([stamp_of(m.header.stamp) - first for m in loop.commands]) / PERIOD
    assert np.median(np.abs(cycles - np.round(cycles))) < 1e-5  # those of a stall's fault lie anywhere
    assert np.median(np.diff(cycles)) == pytest.approx(1.0, abs=1e-5)
    ahead = []  # looks of a listener that hears two topics, each late at times

    def look():
        command, state = (stamp_of(heard[-1].header.stamp) for heard in (loop.commands, loop.states))
        ahead.append((command - state) / PERIOD)
        return len(ahead) > 60

    begun = stamp_of(loop.commands[-1].header.stamp)
    loop.listener.until(lambda: stamp_of(loop.states[-1].header.stamp) >= begun)
    loop.listener.until(look)
    assert np.median(ahead) < 2.5


def test_steps_stay_within_the_limit_and_reach_their_value(loop):
    begun = len(loop.commands)
    loop.hold(0.0, lambda: len(loop.commands) > begun + RATE)  # the first one after a pause is no step
    loop.hold(40.0, lambda: abs(loop.wrenches[-1].wrench.torque.z - 40.0) < 0.5)
    reached = stamp_of(loop.wrenches[-1].header.stamp)  # a busy listener hears what led there later
    loop.hold(40.0, lambda: stamp_of(loop.commands[-1].header.stamp) > reached)
    torques = np.array([m.effort[0] for m in loop.commands])
    assert 30.0 < np.abs(torques).max() <= 60.0 + 1e-9
    loop.hold(0.0, lambda: abs(loop.wrenches[-1].wrench.torque.z) < 0.5)


def test_a_desired_torque_that_ceases_and_comes_back_is_no_step(loop, listener):
    """50 to 61 N m at the motor for 10 N m, when their sender died or was held up for 50 ms."""
    loop.hold(10.0, lambda: all(abs(m.wrench.torque.z - 10.0) < 0.5 for m in loop.wrenches[-60:]))
    since = time.time_ns()  # those of the step from what came before, heard late, are not meant
    listener.until(lambda: abs(loop.wrenches[-1].wrench.torque.z) < 0.5)
    loop.hold(10.0, lambda: abs(loop.wrenches[-1].wrench.torque.z - 10.0) < 0.5)
    assert max(abs(m.effort[0]) for m in loop.commands if stamp_of(m.header.stamp) > since) < 20.0


def test_a_second_publisher_of_the_desired_torque_is_counted_and_not_obeyed(loop, listener):
    """10 beside -10 N m were 48 to 68 N m at the motor, without a word."""
    loop.hold(10.0, lambda: all(abs(m.wrench.torque.z - 10.0) < 0.5 for m in loop.wrenches[-60:]))
    other, since = listener.node.create_publisher(JointState, "/rsea/desired_torque", COMMAND), time.time_ns()

    def is_told():
        other.publish(torque_command_message(time.time_ns(), -10.0))
        values = loop.values()
        return "torques of a second publisher ignored" in values[""] and int(values["ignored_desired"]) > 50

    loop.hold(10.0, is_told)
    listener.node.destroy_publisher(other)
    beside = [abs(m.effort[0]) for m in loop.commands if stamp_of(m.header.stamp) > since]
    assert len(beside) > 20 and max(beside) < 20.0


def test_without_measurements_the_torque_ends_until_the_fault_is_cleared(loop, start, model, listener):
    loop.hold(20.0, lambda: abs(loop.wrenches[-1].wrench.torque.z - 20.0) < 0.5)
    loop.plant.kill()
    loop.hold(20.0, lambda: "no usable measurement" in loop.values()[""])  # not a stall's
    listener.until(lambda: loop.commands[-1].effort[0] == 0.0)
    start("plant", rig=model, rate=RATE)
    seen = len(loop.states)
    listener.until(lambda: len(loop.states) > seen + 50, lambda: loop.desire(20.0))  # which clears nothing
    assert all(m.effort[0] == 0.0 for m in loop.commands[-20:])
    listener.call("/rsea/controller/clear_fault")
    loop.hold(20.0, lambda: abs(loop.wrenches[-1].wrench.torque.z - 20.0) < 0.5)


def test_a_reversed_axis_is_a_fault_before_there_is_torque(start, listener):
    """It was 68 N m at the motor, before any desired torque was sent."""
    spaces = {"__ns": "/turned"}
    start("plant", remaps=spaces, rate=RATE)
    start("controller", remaps=spaces, axis="-torque.z", **GAINS)
    turned = Loop(listener, "/turned")
    listener.until(lambda: len(turned.commands) > 100)
    assert not any(m.effort[0] for m in turned.commands)
    turned.hold(10.0, lambda: any("ft is reversed" in m.status[0].message for m in turned.health))
    listener.until(lambda: any(m.effort[0] for m in turned.commands))  # heard after what they showed
    assert 0.0 < max(abs(m.effort[0]) for m in turned.commands) < 5.0


def test_at_its_end_the_controller_commands_zero(loop, listener):
    assert loop.controller.stop(signal.SIGTERM) == 0
    listener.until(lambda: loop.commands[-1].effort[0] == 0.0)
