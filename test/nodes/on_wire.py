"""A driver node on a simulated bench, and a driver made of a script."""

from pathlib import Path

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from msg_adapters.ros import DiagnosticArray, JointState, Trigger, torque_command_message
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.nodes._qos import COMMAND
from test.nodes.stalls import is_stall

ROOT = Path(__file__).resolve().parents[2]
PATIENT = {
    "rate": 100.0, "latency": 0.1, "ft_timeout": 0.5, "command_timeout": 5.0, "autostart": True,
    "resume": True,
}  # fmt: skip
"""A machine that is busy with other tests must not look like a fault."""


class Driven:
    """A driver on a bench, in a namespace of its own. parameters: beside those of the bench.

    health: the messages of /diagnostics. joint, stamp: of its commands; 0 ns: they act on arrival.
    """

    joint, stamp = "joint", staticmethod(lambda: 0)

    def __init__(self, bench, listener, name, begin, parameters=PATIENT):
        self.bench, self.name, self._listener = bench, name, listener
        self._commands = listener.node.create_publisher(JointState, f"/{name}/torque_command", COMMAND)
        ways = "clear_fault", "reboot"
        self._clear, self._reboot = (
            listener.node.create_client(Trigger, f"/{name}/driver/{way}") for way in ways
        )
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self.cleared = []
        self.process = begin("driver", remaps={"__ns": f"/{name}"}, **bench.parameters(), **parameters)

    def push(self, condition, torque=10.0, mend=lambda: None):
        """Command a torque until the condition holds; clear what a busy machine has latched."""
        try:
            self._listener.until(
                condition, lambda: self.publish(torque), lambda: (self._clear_stall(), mend())
            )
        except AssertionError as vain:
            heard, status = self._commands.get_subscription_count(), self._newest()
            said = {pair.key: pair.value for pair in status.values} if status else None
            raise AssertionError(f"{vain}\n{self.name}: {heard} hear it, {self.goal()}, {said}") from None

    def publish(self, torque):
        """Publish a command."""
        self._commands.publish(torque_command_message(self.stamp(), torque, self.joint))

    def value(self, key):
        """The newest value that the driver's diagnostics have."""
        return value_in(self._newest(), key)

    def latched(self):
        """The fault that was published last, once there is one."""
        fault = self.value("fault")
        return None if fault in (None, "none") else fault

    def _newest(self):
        return newest_status(self.health, f"/{self.name}/driver")

    def _clear_stall(self):
        fault = self.value("fault")
        if is_stall(fault):
            self.cleared.append(fault)
            way = self._reboot if fault.startswith("hardware_error") else self._clear
            way.call_async(Trigger.Request())

    def drive(self):
        """Wait until the motor has its torque; activate what a busy machine has kept from being activated."""
        self.push(self._driving, mend=self._activate)

    def _activate(self):
        """Also configure one whose bench stood still while it was opened: it says nothing of being active."""
        status = self._newest()
        if status is not None and value_in(status, "active") is None:
            self.change(Transition.TRANSITION_CONFIGURE)
        elif value_in(status, "active") == "False":
            self.change(Transition.TRANSITION_ACTIVATE)

    def _driving(self):
        goal, on = self.goal()
        return goal != 0 and on

    def goal(self):
        """The goal in counts that the motor got last, and whether its torque is on."""
        return self.bench.torque()

    def counts(self, torque):
        """A torque (N m) in counts of the goal, on 54024."""
        return round(torque / 6.826 / TABLES[54024].ampere)

    def call(self, kind, service, request):
        """Call a service of the driver; return its answer."""
        return self._listener.call(f"/{self.name}/driver/{service}", kind, request)

    def trigger(self, service):
        """Call a Trigger service."""
        return self.call(Trigger, service, Trigger.Request())

    def request(self, service):
        """Call a Trigger service; return the future of its answer. For one that was called before."""
        client = self._listener.clients[f"/{self.name}/driver/{service}"]
        return client.call_async(Trigger.Request())

    def change(self, transition):
        """Ask for a transition of the lifecycle."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return self.call(ChangeState, "change_state", request)


def newest_status(health, name):
    """The newest status of a node in messages of /diagnostics, None without."""
    return next((s for message in reversed(health) for s in message.status if s.name == name), None)


def value_in(status, key):
    """A value of a status, None without."""
    return {pair.key: pair.value for pair in status.values}.get(key) if status else None
