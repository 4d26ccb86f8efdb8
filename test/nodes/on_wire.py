"""A driver node on a simulated bench, and a driver made of a script."""

import time
from pathlib import Path

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from msg_adapters.ros import DiagnosticArray, JointState, Trigger, torque_command_message
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.nodes._qos import COMMAND
from test.nodes.stalls import every, is_stall

ROOT = Path(__file__).resolve().parents[2]
PATIENT = {
    "rate": 100.0, "latency": 0.1, "ft_timeout": 0.5, "command_timeout": 5.0, "autostart": True,
    "resume": True,
}  # fmt: skip
"""A machine that is busy with other tests must not look like a fault."""
WAIT = 55.0
"""s for what normally takes one: the driver starts and compiles beside other tests."""


class Driven:
    """A driver on a bench, in a namespace of its own. parameters: beside those of the bench."""

    def __init__(self, bench, listener, name, begin, parameters=PATIENT):
        self.bench, self.name, self._listener = bench, name, listener
        self._commands = listener.node.create_publisher(JointState, f"/{name}/torque_command", COMMAND)
        self._clear = listener.node.create_client(Trigger, f"/{name}/driver/clear_fault")
        self._health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self.cleared = []
        self.process = begin("driver", remaps={"__ns": f"/{name}"}, **bench.parameters(), **parameters)

    def push(self, condition, torque=10.0):
        """Command a torque until the condition holds; clear what a busy machine has latched."""
        begun, clear_now_and_then = time.monotonic(), every(1.5, self._clear_stall)

        def push_commands():
            assert time.monotonic() < begun + WAIT, self.process.output[-5:]
            self._commands.publish(torque_command_message(0, torque))
            if not (result := condition()):
                clear_now_and_then()
            return result

        self._listener.until(push_commands)

    def _clear_stall(self):
        fault = newest_value(self._health, self.name, "fault")
        if is_stall(fault):
            self.cleared.append(fault)
            self._clear.call_async(Trigger.Request())

    def drive(self):
        """Wait until the motor has its torque."""
        self.push(self._driving)

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
        client = self._listener._clients[f"/{self.name}/driver/{service}"]
        return client.call_async(Trigger.Request())

    def change(self, transition):
        """Ask for a transition of the lifecycle."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return self.call(ChangeState, "change_state", request)


def newest_value(health, namespace, key):
    """The newest value that a driver's diagnostics have."""
    for message in reversed(health):
        if message.status[0].name == f"/{namespace}/driver":
            return {pair.key: pair.value for pair in message.status[0].values}.get(key)
    return None
