"""The driver node on a simulated bench: what it publishes, its services, zero torque on every way out."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition

from msg_adapters.ros import JointState, WrenchStamped
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from test.nodes.on_wire import Driven, newest_status
from test.nodes.warm import Bench


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A function that gives the bench with a motor of a model."""
    made = {}

    def place(model):
        if model not in made:
            kind = "--can" if isinstance(model, str) else "--model"
            made[model] = Bench(tmp_path_factory.mktemp("wire") / "tty", kind, model)
        return made[model]

    yield place
    for each in made.values():
        each.close()


@pytest.fixture(scope="module")
def wire(bench, start, listener):
    """One driver on 54024 for most tests, in their order."""
    return Driven(bench(54024), listener, "main", start)


def test_the_driver_publishes_what_the_bench_sent_and_follows_commands(wire, listener):
    states = listener.hear(JointState, "/main/joint_states", MEASUREMENT)
    wrenches = listener.hear(WrenchStamped, "/main/ft", MEASUREMENT)
    wire.drive()
    wire.push(lambda: len(states) > 50 and len(wrenches) > 50 and states[-1].effort[0] > 9.0)
    wire.push(lambda: 8.0 < wrenches[-1].wrench.torque.z < 12.0)  # a busy listener hears them after states
    assert wire.goal() == (wire.counts(10.0), True)
    table = TABLES[54024]
    start = table.sample[0]
    sent = [bytes.fromhex(data) for t, at, data in wire.bench.log()["replies"] if at == start]
    origin = table.position.value(sent[0], start)
    velocities = {round(table.velocity.value(data, start) * table.radian_per_second, 12) for data in sent}
    positions = {table.position.value(data, start) - origin for data in sent}
    for message in states:
        assert round(message.position[0] * table.pulses / 6.283185307179586) in positions
        assert round(message.velocity[0], 12) in velocities


def test_commands_beyond_the_limit_are_cut_down_and_counted(wire, listener):
    wire.push(lambda: wire.goal()[0] == wire.counts(68.0), torque=500.0)
    listener.until(lambda: any("commands limited to 68 N·m" in line for line in wire.process.output))
    wire.push(lambda: wire.goal()[0] == wire.counts(10.0))


def test_zero_ft_is_refused_under_torque_and_takes_the_offset_away_without(wire, listener):
    """Also one of another client of the sensor, 20 N·m, which was taken for a torque without a word.

    Where a stall of the machine ends the torque meanwhile it is the spring's zero, and the motor alone tells.
    """
    wire.push(lambda: wire.goal() == (wire.counts(20.0), True), torque=20.0)
    answer = wire.trigger("zero_ft")
    assert not answer.success and "N·m is commanded, expected 0 N·m" in answer.message
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        bias = bytes((0x12, 0x34, 0, 0x42, 0, 0, 0, 0)), ("127.0.0.1", wire.bench.ft_port)
        wire.push(  # again and again: the sensor of a bench that stood still has not seen the torque yet
            lambda: "less momentum" in newest_status(wire.health, "/main/driver").message, 20.0,
            lambda: other.sendto(*bias),
        )  # fmt: skip
    wire.push(lambda: wire.goal()[0] == 0, torque=0.0)
    wire.push(lambda: wire.trigger("zero_ft").success, torque=0.0)  # refused while the load still swings
    assert wire.trigger("clear_fault").success


def test_fifty_stops_at_once_are_answered(wire, listener):
    """A queue of ten lost 36 of them, and their callers waited for ever."""
    assert wire.trigger("stop").success
    answers = [wire.request("stop") for _ in range(50)]
    listener.until(lambda: all(answer.done() for answer in answers))
    assert wire.trigger("clear_fault").success


def test_a_fault_is_published_keeps_excite_away_and_ends_by_service(wire, listener, start):
    """It played to the end, and the recording showed a machine that never moved."""
    told = "temperature: 90 °C, limit 70 °C"
    wire.drive()
    wire.bench.ask("set", temperature=90)
    wire.push(lambda: wire.goal() == (0, True) and wire.value("fault") == told)
    commands = listener.hear(JointState, "/main/torque_command", COMMAND)
    excite = start("excite", remaps={"__ns": "/main"}, amplitude=3.0, noise=0.0, duration=200.0, rate=100.0)
    listener.until(lambda: not excite.is_running())
    assert excite.wait() == 2 and told in excite.output[-1]
    assert excite.output[-1].endswith("rsea call /main/driver clear_fault")
    assert not any(message.effort[0] for message in commands)
    refused = wire.change(Transition.TRANSITION_DEACTIVATE), wire.change(Transition.TRANSITION_ACTIVATE)
    assert [answer.success for answer in refused] == [True, False]
    wire.bench.ask("set", temperature=30)
    assert wire.trigger("clear_fault").success
    assert wire.change(Transition.TRANSITION_ACTIVATE).success
    wire.drive()


LISTENER = (
    "import rclpy\nfrom sensor_msgs.msg import JointState\nrclpy.init()\nnode = rclpy.create_node('held')\n"
    "node.create_subscription(JointState, '/main/joint_states', lambda message: None, 10)\nrclpy.spin(node)\n"
)


def _is_undisturbed(wire):
    """Whether commands reach the motor and no fault is latched meanwhile."""
    cleared = len(wire.cleared)
    for torque in (20.0, 10.0, 20.0, 10.0):
        wire.push(lambda torque=torque: wire.goal()[0] == wire.counts(torque), torque=torque)
    answer = wire.trigger("clear_fault").message
    return len(wire.cleared) == cleared and answer == "clear_fault: there is no fault; nothing was done"


def test_a_stopped_listener_holds_up_nobody(wire, listener):
    """Fast DDS waited a second for a listener that was stopped while it read shared memory."""
    program = Path(f"/proc/{wire.process.pid}/maps").read_text()
    assert "/dev/shm/fast" not in program, "a publisher waits for who has locked the shared memory"
    count = listener.node.count_subscribers("/main/joint_states")
    held = subprocess.Popen([sys.executable, "-c", LISTENER], stdin=subprocess.DEVNULL)
    try:
        listener.until(lambda: listener.node.count_subscribers("/main/joint_states") > count)
        wire.drive()
        held.send_signal(signal.SIGSTOP)
        # A busy machine latches a fault now and then; a driver that waits for its listener does each time.
        assert any(_is_undisturbed(wire) for _ in range(3)), wire.cleared
    finally:
        held.kill()
        held.wait()


def test_after_deactivation_the_torque_is_zero_and_off(wire, listener):
    wire.drive()
    assert wire.change(Transition.TRANSITION_DEACTIVATE).success
    assert wire.goal() == (0, False)
    states = listener.hear(JointState, "/main/joint_states", MEASUREMENT)
    wire.push(lambda: len(states) > 40)
    assert wire.goal() == (0, False), "a configured driver measures and passes no command"
    assert wire.change(Transition.TRANSITION_CLEANUP).success
    listener.until(lambda: not listener.node.count_publishers("/main/joint_states"))
    assert wire.change(Transition.TRANSITION_CONFIGURE).success
    assert wire.change(Transition.TRANSITION_ACTIVATE).success


def test_a_motor_that_is_away_at_cleanup_is_switched_off_when_it_is_back(wire):
    """Its 10 N m went on for good, and the driver said: torque zero, device closed."""
    wire.drive()
    wire.bench.ask("vanish")
    assert wire.change(Transition.TRANSITION_DEACTIVATE).success
    assert not wire.change(Transition.TRANSITION_CLEANUP).success
    assert not wire.change(Transition.TRANSITION_ACTIVATE).success and wire.goal()[1]
    wire.bench.ask("appear")
    assert wire.change(Transition.TRANSITION_CLEANUP).success and wire.goal() == (0, False)
    assert wire.change(Transition.TRANSITION_CONFIGURE).success
    assert wire.change(Transition.TRANSITION_ACTIVATE).success


def test_after_sigint_the_torque_is_zero_and_off(wire):
    wire.drive()
    assert wire.process.stop(signal.SIGINT) == 0
    assert wire.goal() == (0, False)


KILLED = {
    54024: (signal.SIGKILL, (0, False)), 54025: (signal.SIGKILL, (0, True)),
    "RS03": (signal.SIGKILL, (0, False)), "AK10-9": (signal.SIGKILL, (0, False)),
    "DM8009": (signal.SIGINT, (0, False)),
}  # fmt: skip
"""By model: the signal that ends its driver, goal and torque then, by the supervisor or by the motor's own
watchdog, which leaves a Dynamixel on at zero."""


def test_after_a_kill_the_torque_is_zero_on_the_wire(bench, start, listener):
    names = {model: f"killed_{model}".lower().replace("-", "_") for model in KILLED}
    victims = {model: Driven(bench(model), listener, names[model], start) for model in KILLED}
    for model, (number, end) in KILLED.items():  # they begin together, and none waits for commands
        victims[model].drive()
        assert victims[model].process.stop(number) == (0 if number == signal.SIGINT else -number), model
        listener.until(lambda model=model, end=end: victims[model].goal() == end)
