"""The driver's lifecycle, and its torque on every way out of it."""

import signal

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import JointState, Trigger, torque_command_message
from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.protection import PROCESS, Protection
from rsea_ros.nodes import driver
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT


class Remote:
    """The driver process as seen from outside."""

    def __init__(self, start, listener):
        self.process = start("driver", rate=200.0)
        self.listener = listener
        self.states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
        self.commands = listener.node.create_publisher(JointState, "/rsea/torque_command", COMMAND)
        self._change = listener.node.create_client(ChangeState, "/rsea/driver/change_state")
        self._get = listener.node.create_client(GetState, "/rsea/driver/get_state")
        listener.until(lambda: self._change.service_is_ready() and self._get.service_is_ready())

    def change(self, transition):
        """Ask for a transition; return whether it succeeded, and the state after it."""
        future = self._change.call_async(ChangeState.Request(transition=Transition(id=transition)))
        self.listener.until(future.done)
        state = self._get.call_async(GetState.Request())
        self.listener.until(state.done)
        return future.result().success, state.result().current_state.label

    def push(self, torque, condition):
        """Command a torque at every measurement until the condition holds."""

        def pushed():
            self.commands.publish(torque_command_message(0, torque))
            return condition()

        self.listener.until(pushed)

    def torque(self):
        """Motor torque of the newest measurement, N m."""
        return self.states[-1].effort[0] if self.states else None


@pytest.fixture(scope="module")
def remote(start, listener):
    """One driver for the tests of this module, in their order."""
    return Remote(start, listener)


def test_a_configured_driver_measures_and_passes_no_command(remote):
    assert remote.change(Transition.TRANSITION_CONFIGURE) == (True, "inactive")
    remote.listener.until(lambda: len(remote.states) > 10)
    count = len(remote.states)
    remote.push(10.0, lambda: len(remote.states) > count + 40)
    assert all(abs(m.effort[0]) < 1.0 for m in remote.states[count:])


def test_an_active_driver_follows_commands_and_a_deactivated_one_makes_no_torque(remote):
    assert remote.change(Transition.TRANSITION_ACTIVATE) == (True, "active")
    remote.push(10.0, lambda: remote.torque() > 9.0)
    remote.push(0.0, lambda: abs(remote.torque()) < 1.0)
    assert remote.change(Transition.TRANSITION_DEACTIVATE) == (True, "inactive")
    remote.push(10.0, lambda: abs(remote.torque()) < 1.0)
    count = len(remote.states)
    remote.push(10.0, lambda: len(remote.states) > count + 40)
    assert all(abs(m.effort[0]) < 1.0 for m in remote.states[count:])


def test_a_cleaned_up_driver_is_silent_and_can_be_configured_again(remote):
    assert remote.change(Transition.TRANSITION_CLEANUP) == (True, "unconfigured")
    topic = "/rsea/joint_states"
    remote.listener.until(lambda: not remote.listener.node.count_publishers(topic))
    assert remote.change(Transition.TRANSITION_CONFIGURE) == (True, "inactive")
    remote.listener.until(lambda: remote.listener.node.count_publishers(topic))


def test_a_signal_closes_the_device_at_zero_torque(remote):
    remote.change(Transition.TRANSITION_ACTIVATE)
    remote.push(10.0, lambda: remote.torque() > 9.0)
    assert remote.process.stop(signal.SIGTERM) == 0
    assert "torque zero, device closed" in remote.process.output[-1]


class Spy:
    """A device that keeps what is written to it; `fault` is raised by the next reading."""

    protection = Protection(PROCESS)

    def __init__(self):
        self.written, self.opened, self.fault = [], False, None

    def open(self):
        self.opened = True

    def read(self):
        if self.fault is not None:
            raise self.fault
        return State(0, 0.0, 0.0, 0.0)

    def write(self, torque):
        self.written.append(torque)

    def enable(self):
        self.on = True

    def disable(self):
        self.written.append(0.0)
        self.on = False

    def zero_ft(self):
        self.zeroed = True

    def recover(self):
        if self.fault is not None:
            raise self.fault

    reboot = recover

    def health(self):
        return {}

    def close(self):
        if self.opened:
            self.written.append(0.0)
        self.opened = False


@pytest.fixture
def spied(listener, make_driver, monkeypatch):
    """An active driver in this process that has written 5 N m to a spy."""
    spy = Spy()
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spy})
    values = {parameter.name: parameter.default for parameter in driver.TABLE}
    given = {"rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0}
    program, node = make_driver("spied", values | given)
    publisher = listener.node.create_publisher(JointState, "/spied/torque_command", COMMAND)

    def push_commands():
        publisher.publish(torque_command_message(0, 5.0))
        return 5.0 in spy.written

    listener.until(push_commands)
    return spy, program, node


def test_a_free_end_without_a_position_limit_is_not_activated_unless_that_is_asked_for(
    make_driver, monkeypatch
):
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: Spy()})
    values = {p.name: p.default for p in driver.TABLE} | {"rig": "bare_drive", "autostart": True}
    told = {}
    for name, given in (
        ("free", {}), ("allowed", {"allow_no_position_limit": True}), ("limited", {"position_limit": 1.0}),
    ):  # fmt: skip
        program, node = make_driver(name, values | given)
        told[name] = node._state_machine.current_state[1]
    assert told == {"free": "inactive", "allowed": "active", "limited": "active"}
    shown = program.joints[0].report().values
    assert shown["refused"] == 0 and "position_limit 1 rad, deflection_limit none" in str(shown["limits"])


@pytest.mark.parametrize("way", ["trigger_deactivate", "trigger_shutdown"])
def test_every_transition_out_of_active_writes_zero(spied, way):
    spy, _, node = spied
    getattr(node, way)()
    assert spy.written[-1] == 0.0


def test_diagnostics_name_the_limits_that_a_simulation_lifts(spied):
    _, program, _ = spied
    assert program.joints[0].report().values["lifted_limits"] == "temperature, current, voltage"


def test_closing_writes_zero_and_releases_the_device(spied):
    spy, program, _ = spied
    program.close()
    assert spy.written[-1] == 0.0 and not spy.opened


def test_a_fault_of_the_device_zeroes_the_torque_until_it_is_cleared(spied, listener):
    spy, program, node = spied
    spy.fault = DeviceError("no answer from ID 1 within 5 ms")
    listener.until(lambda: program.joints[0].guarded.fault is not None)
    listener.until(lambda: spy.written[-1] == 0.0)
    told = program.joints[0].report()[1].partition("; ")[0]  # what a busy machine adds, such as cycles missed
    assert told == "fault deviceerror: no answer from ID 1 within 5 ms"
    clear = listener.node.create_client(Trigger, "/spied/spied/clear_fault")
    listener.until(clear.service_is_ready)
    assert not _call(clear, listener).success
    spy.fault = None
    assert _call(clear, listener).success
    assert program.joints[0].guarded.fault is None and spy.on
    assert node._state_machine.current_state[1] == "active"


def test_after_an_exception_the_device_is_closed_at_zero_torque_and_can_be_configured_again(spied, listener):
    spy, program, node = spied
    spy.fault = ZeroDivisionError("a mistake in the program")
    listener.until(lambda: not spy.opened)
    assert spy.written[-1] == 0.0
    program.is_finished()
    assert node._state_machine.current_state[1] == "unconfigured"
    assert program.joints[0].report()[1] == "a mistake in the program"
    spy.fault = None
    node.trigger_configure()
    assert node._state_machine.current_state[1] == "inactive" and spy.opened


def _call(client, listener):
    """The answer of a service."""
    future = client.call_async(Trigger.Request())
    listener.until(future.done)
    return future.result()


def test_two_actuators_each_follow_only_their_own_commands(listener, monkeypatch):
    """A command for left_knee moved whatever listened."""
    spies = {name: Spy() for name in ("left", "right")}
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spies[values["joint"][:-5]]})
    values = {parameter.name: parameter.default for parameter in driver.TABLE} | {
        "rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0, "effort_limit": 0.0,
    }  # fmt: skip
    made, topic = [], {}
    for name in spies:
        node = LifecycleNode("driver", namespace=name)
        made.append((driver.DriverNode(node, values | {"joint": f"{name}_knee"}), node))
        topic[name] = listener.node.create_publisher(JointState, f"/{name}/torque_command", COMMAND)

    def pushed():
        for name in spies:
            topic[name].publish(torque_command_message(0, 5.0, "left_knee"))
        return spies["left"].written[-1:] == [5.0] and made[1][0].joints[0].topics.commands.refused > 3

    listener.until(pushed)
    assert not any(spies["right"].written)
    for program, node in made:
        program.close()
        node.destroy_node()
