"""Real node processes, and a listener in this one, on the worker's own ROS domain."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import Trigger
from rsea_ros.nodes import driver
from rsea_ros.nodes._run import PROFILE, RANGE, use_sockets
from rsea_ros.plugins import node_modules
from test.nodes.warm import parent

try:  # a message costs half as much of the processor
    from rclpy.experimental import EventsExecutor
except ImportError:  # of an older distribution
    EventsExecutor = SingleThreadedExecutor

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TIMEOUT = 60.0
"""Seconds for what normally takes one; a cold start compiles the simulation on a busy machine."""
AGAIN = 15.0
"""s without an answer, which no service takes."""
LOOK = 0.004
"""s between looks: one for each message that is heard takes more of the processor than hearing it."""


class Process:
    """A node of the package, or of this folder, started with parameters."""

    def __init__(self, name, log, parameters, remaps):
        words = [w for key, value in parameters.items() for w in ("-p", f"{key}:={as_argument(value)}")]
        words += [w for old, new in remaps.items() for w in ("-r", f"{old}:={new}")]
        self._log = log
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(log.parent / "ros")}
        log.touch()
        files = os.devnull, log, log
        module = name if (HERE / f"{name}.py").is_file() else node_modules()[name]
        self._process = parent().start(module, ["--ros-args", *words], environment, files)

    @property
    def output(self):
        """What it has written so far, as lines."""
        return self._log.read_text().splitlines()

    @property
    def pid(self):
        """Its number."""
        return self._process.pid

    def is_running(self):
        """Whether it has not ended."""
        return self._process.poll() is None

    def wait(self):
        """Wait for its end and return its status."""
        return self._process.wait(TIMEOUT)

    def stop(self, number=signal.SIGINT):
        """Send a signal and return the exit status."""
        if self.is_running():
            self._process.send_signal(number)
        return self.wait()

    def kill(self):
        """End it without asking."""
        self._process.kill()
        self._process.wait()


STARTED: list[Process] = []
"""The nodes of the module under test."""


def told(lines=4):
    """Return the last lines of each node that runs: one of them may explain what did not come."""
    running = (node for node in STARTED if node.is_running())
    return "\n".join("\n".join([f"-- {node.pid}", *node.output[-lines:]]) for node in running)


def as_argument(value):
    """Return a value as a parameter on the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(as_argument, value))}]"
    return f"'{value}'" if isinstance(value, (str, Path)) else str(value)


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """A function that starts a node; what still runs after the module is killed."""

    def begin(name, remaps=(), **parameters):
        log = tmp_path_factory.mktemp(name) / "output.log"
        STARTED.append(Process(name, log, parameters, dict(remaps)))
        return STARTED[-1]

    yield begin
    while STARTED:
        STARTED.pop().kill()


class Listener:
    """A node in this process; it spins while it waits for something to be true."""

    def __init__(self, executor):
        with pytest.MonkeyPatch.context() as patch:
            for name in (RANGE, PROFILE):  # the nodes of a test say so themselves
                patch.setenv(name, os.environ.get(name, ""))
            patch.delenv(PROFILE)
            use_sockets()
            rclpy.init()
            self.node = rclpy.create_node("listener")
        self.executor = executor()
        self.executor.add_node(self.node)
        self.subscriptions, self.clients = [], {}

    def serve(self, node):
        """Spin another node of this process too, until it is dropped. Its module says SERVES."""
        assert isinstance(self.executor, SingleThreadedExecutor)
        self.executor.add_node(node)

    def drop(self, node):
        """Serve a node no more, and take it away."""
        self.executor.remove_node(node)
        node.destroy_node()

    def until(self, condition, act=lambda: None, mend=lambda: None, pause=0.6):
        """Spin until the condition holds, and return what it returned.

        act: done before each look, such as to command. mend: done once in `pause` s, such as to clear what a
        machine that stalls has latched. Looks are LOOK apart, in which everything is heard that comes.
        """
        begun = mended = time.monotonic()
        while True:
            act()
            if result := condition():
                return result
            now = time.monotonic()
            assert now < begun + TIMEOUT, f"waited in vain\n{told()}"
            if now > mended + pause:
                mended = now
                mend()
            while time.monotonic() < now + LOOK:  # with another time rclpy forgets what else was ready
                self.executor.spin_once(timeout_sec=LOOK)

    def call(self, name, kind=Trigger, request=None):
        """Call a service; return its answer.

        Called again where it does not come: the first answer to a new client is lost now and then, because
        the node has found the client's requests before it found where the answers go.
        """
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        client, answers = self.clients[name], []
        self.until(client.service_is_ready)

        def ask():
            answers.append(client.call_async(request or kind.Request()))

        ask()
        done = self.until(lambda: next((a for a in answers if a.done()), None), mend=ask, pause=AGAIN)
        return done.result()

    def hang_up(self):
        """Forget the clients. One made anew meets a new node at once, an old one may after 3 s.

        What an old one is called goes to the new node when that is found; where it is lost, it comes again
        with the heartbeat of the discovery, whose 3 s no profile changes.
        """
        while self.clients:
            self.node.destroy_client(self.clients.popitem()[1])

    def hear(self, kind, topic, qos):
        """Return a list that fills with the messages of a topic."""
        heard = []
        self.subscriptions.append(self.node.create_subscription(kind, topic, heard.append, qos))
        return heard

    def forget(self, kept=0):
        """Hear nothing any more but the first topics that it was asked to hear."""
        for subscription in self.subscriptions[kept:]:
            self.node.destroy_subscription(subscription)
        del self.subscriptions[kept:]

    def close(self):
        """Take the node away."""
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()


@pytest.fixture(scope="module")
def listener(request):
    """One listener for a module's tests. SERVES in a module: it spins nodes of the package, too."""
    node = Listener(SingleThreadedExecutor if hasattr(request.module, "SERVES") else EventsExecutor)
    yield node
    node.close()


@pytest.fixture(autouse=True)
def what_a_test_hears(request):
    """Hear what a test asks for only as long as it lasts: each message costs each who hears it 60 us."""
    listener = request.getfixturevalue("listener") if "listener" in request.fixturenames else None
    kept = len(listener.subscriptions) if listener else 0
    yield
    if listener:
        listener.forget(kept)


DRIVEN = {parameter.name: parameter.default for parameter in driver.TABLE} | {
    "rate": 200.0, "autostart": True, "resume": True, "command_timeout": 5.0,
}  # fmt: skip
"""Parameters of a driver that is active at once, and patient."""


@pytest.fixture
def make_driver(listener):
    """A function that makes a driver in this process, by DRIVEN or other values, and those that are given."""
    made = []

    def make(name, *overrides, values=None, **given):
        node = LifecycleNode(name, namespace=name, parameter_overrides=list(overrides))
        made.append((driver.DriverNode(node, (values or DRIVEN) | given), node))
        listener.serve(node)
        return made[-1]

    yield make
    for program, node in made:
        program.close()
        listener.drop(node)


DOUBLE = 3


def setting(**values):
    """Return the request that sets parameters together."""
    request = SetParametersAtomically.Request()
    for name, value in values.items():
        told = ParameterValue(type=DOUBLE, double_value=value)
        request.parameters.append(Parameter(name=name.replace("__", "."), value=told))
    return request


@pytest.fixture
def put(listener):
    """A function that sets parameters of a node over its service; its answer's reason, empty for none."""

    def ask(node, **values):
        request = setting(**values)
        name = node if isinstance(node, str) else node.get_fully_qualified_name()
        service = f"{name}/set_parameters_atomically"
        answer = listener.call(service, SetParametersAtomically, request).result
        assert answer.successful == (not answer.reason)
        return answer.reason

    return ask
