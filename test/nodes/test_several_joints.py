"""Several joints of one bus in one driver: each with commands, limits, faults and services of its own."""

import threading
import time

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import DiagnosticArray, JointState, Trigger, stamp_of, torque_command_message
from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware.interlock import event
from rsea_ros.nodes import driver
from rsea_ros.nodes._joint import stop
from rsea_ros.nodes._joints import joint_table
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT
from test.nodes.on_wire import newest_status, value_in
from test.nodes.stalls import is_stall
from test.nodes.test_driver import Spy
from test.nodes.warm import Bench

SERVES = True
JOINTS = ("hip", "knee", "ankle")
TRIALS = 10
X = {
    "torque_limit": 3.0, "current_limit": 3.2, "voltage_limit": 10.0, "effort_limit": 0.0, "ft_limit": 0.0,
    "power_limit": 20.0, "deflection_limit": 0.0, "ft_host": "", "rig": "bare_drive",
    "allow_no_position_limit": True,
}  # fmt: skip
"""Of small motors of the X series without a spring."""
RATE = 100.0
"""Hz, of the cycles with the limits of config/nodes."""


def values_of(**given):
    """The values of a driver node with parameters, as `declare` makes them."""
    table = [*driver.TABLE, *joint_table(driver.TABLE, given)]
    return {p.name: p.check(given.get(p.name, p.default)) for p in table}


def test_a_parameter_not_given_for_a_joint_is_that_of_the_node():
    values = values_of(joints=["hip", "knee"], torque_limit=20.0, **{"knee.torque_limit": 5})
    assert (values["hip.torque_limit"], values["knee.torque_limit"]) == (20.0, 5.0)
    assert "hip.rate" not in values and "hip.joint" not in values


BUS = {"device": "dynamixel_netft", "ft_host": "", "deflection_limit": 0.0, "ft_limit": 0.0}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"joints": ["hip", "hip"]}, "hip twice, expected each joint once"),
        ({"joints": ["left knee"]}, "'left knee', expected letters"),
        ({"joints": "hip"}, "joints = 'hip', expected a list of texts"),
        ({"joints": ["hip"], "hip.torque_limit": -2.0}, "hip.torque_limit = -2.0, expected a number"),
        ({**BUS, "joints": ["hip", "knee"]}, "knee.id = 1, expected another than hip's"),
        (
            {**BUS, "joints": ["hip", "knee"], "knee.id": 2, "knee.baud": 57600},
            "knee.baud = 57600, expected 1000000 as hip's on /dev/ttyUSB0",
        ),
        (
            {"device": "dynamixel_netft", "joints": ["hip", "knee"], "knee.id": 2},
            "knee.ft_host = 192.168.1.1, expected another than hip's",
        ),
    ],
)  # fmt: skip
def test_impossible_joints_are_refused(listener, given, told):
    node = LifecycleNode("refused", namespace="refused")
    with pytest.raises(ParameterError, match=told):
        driver.DriverNode(node, values_of(**given))
    node.destroy_node()


class Leg:
    """The driver process of three motors on one line, which a thread commands as often as its cycles.

    They are slower than 280 Hz: three motors of one bench process do not keep up on a busy machine.
    """

    def __init__(self, bench, start, listener):
        self.bench, self.listener = bench, listener
        ids = {f"{joint}.id": k + 1 for k, joint in enumerate(JOINTS)}
        known = {**bench.parameters(), **X, "baud": 4_000_000, "autostart": True, "resume": True}
        known |= {"joints": list(JOINTS), "rate": RATE, "hip.ft_host": "127.0.0.1"}
        self.process = start("driver", {"__ns": "/leg"}, **known, **ids)
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self.states = {j: listener.hear(JointState, f"/leg/{j}/joint_states", MEASUREMENT) for j in JOINTS}
        self.combined = listener.hear(JointState, "/leg/joint_states", MEASUREMENT)
        self.commands = {
            j: listener.node.create_publisher(JointState, f"/leg/{j}/torque_command", COMMAND) for j in JOINTS
        }
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._command, daemon=True)
        self._thread.start()

    def _command(self):
        while not self._over.wait(1.0 / RATE):
            for joint, torque in TORQUES.items():
                self.commands[joint].publish(torque_command_message(time.time_ns(), torque, joint))

    def close(self):
        """Command no more."""
        self._over.set()
        self._thread.join()

    def until(self, condition):
        """Wait for a condition; clear what a machine that stands still has latched."""
        self.listener.until(condition, self.lives, self.clear_stalls, 0.5)

    def lives(self):
        """See that the driver has not ended."""
        assert self.process.is_running(), self.process.output[-5:]

    def clear_stalls(self):
        """Clear faults that no test here provokes: commands may cease, too, on a machine that stalls."""
        if any(is_stall(fault) or fault.startswith("command_timeout") for fault in self.faults()):
            self.call("clear_fault")
        if "False" in (self.value(joint, "active") for joint in JOINTS):  # a stall kept one from it
            request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_ACTIVATE))
            self.listener.call("/leg/driver/change_state", ChangeState, request)

    def ready(self):
        """Wait until every motor has a torque and no fault is latched."""
        self.until(lambda: all(self.goals()) and set(self.faults()) == {"none"})

    def together(self):
        """The stamps of the hip (ns) that the other joints have too, to 50 us."""
        hip, *others = ([stamp_of(m.header.stamp) for m in self.states[j][-200:]] for j in JOINTS)
        return [at for at in hip if all(min(abs(at - t) for t in other) < 50_000 for other in others)]

    def goals(self):
        """The goals in counts, zero where the torque is off."""
        return [goal if on else 0 for goal, on in (self.bench.torque(place) for place in range(3))]

    def value(self, joint, key):
        """The newest value that a joint's diagnostics have."""
        return value_in(newest_status(self.health, f"/leg/driver/{joint}"), key)

    def faults(self):
        """The newest fault of each joint in words."""
        return [self.value(joint, "fault") or "unknown" for joint in JOINTS]

    def acting(self, place, since):
        """Whether each write to a motor since an instant was of a torque that acts."""
        log = self.bench.ask("log", motor=place, since=since)["result"]["torque"]
        return [goal != 0 and on for _, goal, on in log]

    def call(self, service):
        """Call a service of the driver; return its answer."""
        return self.listener.call(f"/leg/driver/{service}")


@pytest.fixture(scope="module")
def leg(tmp_path_factory, start, listener):
    with Bench(tmp_path_factory.mktemp("leg") / "tty", "--model", 1020, 1120, 1170) as bench:
        bench.hurry()
        made = Leg(bench, start, listener)
        yield made
        made.close()


TORQUES = {"hip": 0.5, "knee": -1.0, "ankle": 2.0}


def test_each_joint_follows_its_commands_in_one_exchange_a_cycle(leg):
    leg.until(lambda: all(
        leg.states[j] and abs(leg.states[j][-1].effort[0] - TORQUES[j]) < 0.3 for j in JOINTS
    ))  # fmt: skip
    assert [list(leg.states[j][-1].name) for j in JOINTS] == [[j] for j in JOINTS]
    leg.until(lambda: len(leg.together()) > 20)  # never, where each had a transaction of its own
    wanted = [TORQUES[joint] for joint in JOINTS]
    leg.until(lambda: leg.combined and np.allclose(leg.combined[-1].effort, wanted, atol=0.3))
    assert [*leg.combined[-1].name] == [*JOINTS] and len(leg.combined[-1].position) == len(JOINTS)
    leg.until(lambda: leg.value("ankle", "motor") == "XW540-T260")


def test_a_fault_of_one_joint_ends_by_its_own_service(leg):
    for _ in range(4):
        leg.ready()
        leg.bench.ask("set", motor=1, temperature=90)
        leg.listener.until(lambda: leg.faults()[1] not in ("none", "unknown"))
        if leg.faults()[1].startswith("temperature"):
            break
        leg.bench.ask("set", motor=1, temperature=30)  # a stall was first: nothing clears it in heat
    refused = leg.call("knee/clear_fault")
    assert not refused.success and "is still there" in refused.message
    leg.bench.ask("set", motor=1, temperature=30)
    leg.until(lambda: leg.call("knee/clear_fault").success)  # a stall may have lost a reply
    leg.ready()


def test_stop_and_clear_fault_of_the_node_act_on_all_joints(leg):
    leg.ready()
    assert leg.call("stop").success
    leg.listener.until(lambda: leg.goals() == [0, 0, 0])
    answer = leg.call("clear_fault")
    assert answer.success and answer.message == "clear_fault: hip done, knee done, ankle done"
    leg.ready()


@pytest.mark.parametrize("order", [("clear_fault", "hip/stop"), ("hip/stop", "clear_fault")])
def test_of_a_stop_and_a_clear_in_the_same_ms_the_stop_holds(leg, order):
    """Requests of two services are taken up in any order: an acknowledged stop was ended, 7 of 9 times."""
    node = leg.listener.node
    clients = [node.create_client(Trigger, f"/leg/driver/{service}") for service in order]
    leg.until(lambda: all(client.service_is_ready() for client in clients))
    for _ in range(2):
        leg.ready()
        assert leg.call("stop").success
        answers = [client.call_async(Trigger.Request()) for client in clients]
        leg.until(lambda answers=answers: all(answer.done() for answer in answers))
        for _ in range(2):  # what is heard first may have been said before
            leg.health.clear()  # and nobody clears what a stall has latched, which would end the stop
            leg.listener.until(lambda: leg.faults()[0] != "unknown")
        assert leg.faults()[0] != "none" and leg.goals()[0] == 0
        leg.until(lambda: leg.call("clear_fault").success)  # not while a stall's fault is still there
    for client in clients:
        node.destroy_client(client)


def test_a_joint_that_is_stopped_while_another_one_is_cleared_stays_stopped(make_driver, monkeypatch):
    """The clear of all joints reached it later than its stop, and ended that: 10 N m after an answer."""
    spies = {"hip": Spy(), "knee": Spy()}
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spies[values["joint"]]})
    program, _ = make_driver("held", values=values_of(joints=["hip", "knee"], autostart=True, resume=True))
    hip, knee = program.joints
    stop([hip, knee])
    for joint in (hip, knee):
        joint.guarded.interlock.answer()
    monkeypatch.setattr(spies["hip"], "recover", lambda: stop([knee]))
    with pytest.raises(DeviceError, match="knee: stopped: ~/stop was called meanwhile"):
        program._clear_faults(event())
    assert hip.guarded.interlock.is_free and knee.guarded.interlock.stopped


def test_all_torques_are_zero_before_the_first_motor_is_closed(listener, monkeypatch):
    """Closing a motor that does not answer takes long; the others held their torque meanwhile."""
    order, spies = [], {"hip": Spy(), "knee": Spy()}
    for name, spy in spies.items():
        monkeypatch.setattr(spy, "write", lambda torque, name=name: order.append((name, torque)))
        monkeypatch.setattr(spy, "close", lambda name=name: order.append((name, "closed")))
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spies[values["joint"]]})
    node = LifecycleNode("ended", namespace="ended")
    program = driver.DriverNode(node, values_of(joints=["hip", "knee"], autostart=True, resume=True))
    program._cycle.stop()
    order.clear()
    program.close()
    node.destroy_node()
    assert order[:2] == [("hip", 0.0), ("knee", 0.0)]
    assert set(order[2:]) == {("hip", "closed"), ("knee", "closed")}


def test_motors_that_are_away_at_cleanup_are_waited_for_together(make_driver, monkeypatch, capfd):
    """3 s of each, one after the other; only the first had its words; and a late cleanup did not say so."""
    monkeypatch.setattr(driver, "RETURN", 0.3)
    spies, away = {"hip": Spy(), "knee": Spy()}, [DeviceError("it is away")]

    def close():
        if away:
            raise away[0]

    for spy in spies.values():
        monkeypatch.setattr(spy, "close", close)
    monkeypatch.setattr(driver, "DEVICES", {"simulated": lambda values: spies[values["joint"]]})
    program, _ = make_driver("waited", values=values_of(joints=["hip", "knee"], autostart=True, resume=True))
    began = time.monotonic()
    with pytest.raises(DeviceError, match="it is away; it is away"):
        program.close()
    assert 0.3 < time.monotonic() - began < 0.6
    away.clear()
    program.close()
    assert capfd.readouterr().err.count("torque zero, device closed") == 1


@pytest.mark.parametrize(
    ("wrong", "right", "causes", "most"),
    [
        (("set", {"motor": 1, "temperature": 90}), ("set", {"motor": 1, "temperature": 30}), {1: "temp"}, 2),
        (
            ("misbehave", {"silent": True}), ("misbehave", {"silent": False}),
            dict.fromkeys(range(3), "no_reply"), 5,
        ),
    ],
)  # fmt: skip
def test_with_the_defaults_a_fault_ends_the_torques_that_it_concerns(leg, wrong, right, causes, most):
    """Counted in writes from the bench's log; a machine that stalls latches faults of its own: then again."""
    for _ in range(TRIALS):
        leg.ready()
        since = leg.bench.ask(wrong[0], **wrong[1])["t"]
        leg.listener.until(lambda: all(leg.faults()[place] != "none" for place in causes))
        writes, faults = [leg.acting(place, since) for place in range(3)], leg.faults()
        leg.bench.ask(right[0], **right[1])
        leg.call("clear_fault")
        spared = all(all(writes[place]) for place in set(range(3)) - causes.keys())
        named = all(faults[place].startswith(causes.get(place, "none")) for place in range(3))
        last = max(k for place in causes for k, acts in enumerate([True, *writes[place]]) if acts)
        if spared and named and last <= most:
            break
    assert spared, "a fault of one joint leaves the others their torque"
    assert named, faults
    assert last <= most, writes


def test_the_end_of_the_driver_ends_all_torques(leg):
    leg.ready()
    assert leg.process.stop() == 0
    assert leg.goals() == [0, 0, 0]
