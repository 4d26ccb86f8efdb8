"""Real node processes, and a listener in this one, on the worker's own ROS domain."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode

from msg_adapters.ros import Trigger
from rsea_ros.nodes import driver
from rsea_ros.nodes._run import PROFILE
from rsea_ros.plugins import node_modules
from test.nodes.stalls import every
from test.nodes.warm import parent

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TIMEOUT = 60.0
"""Seconds for what normally takes one; a cold start compiles the simulation on a busy machine."""
QUICK = {PROFILE: str(HERE / "quick_repairs.xml")}
SOCKETS = "driver", "controller"
"""Nodes that have a profile of their own."""
AGAIN = 15.0
"""s without an answer, which no service takes."""


class Process:
    """A node of the package, or of this folder, started with parameters."""

    def __init__(self, name, log, parameters, remaps):
        words = [w for key, value in parameters.items() for w in ("-p", f"{key}:={as_argument(value)}")]
        words += [w for old, new in remaps.items() for w in ("-r", f"{old}:={new}")]
        self._log = log
        quick = {} if name in SOCKETS else QUICK
        environment = {**os.environ, **quick, "PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(log.parent / "ros")}
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
    started = []

    def begin(name, remaps=(), **parameters):
        log = tmp_path_factory.mktemp(name) / "output.log"
        started.append(Process(name, log, parameters, dict(remaps)))
        return started[-1]

    yield begin
    for process in started:
        process.kill()


class Listener:
    """A node in this process; it spins while it waits for something to be true."""

    def __init__(self):
        with pytest.MonkeyPatch.context() as patch:  # the first node of a process reads its profile
            patch.setenv(PROFILE, QUICK[PROFILE])
            rclpy.init()
            self.node = rclpy.create_node("listener")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.subscriptions, self._clients = [], {}

    def serve(self, node):
        """Spin another node of this process too, until it is dropped."""
        self._executor.add_node(node)

    def drop(self, node):
        """Serve a node no more, and take it away."""
        self._executor.remove_node(node)
        node.destroy_node()

    def until(self, condition):
        """Spin until the condition holds, and return what it returned."""
        deadline = time.monotonic() + TIMEOUT
        while not (result := condition()):
            assert time.monotonic() < deadline, "waited in vain"
            self._executor.spin_once(timeout_sec=0.01)  # conditions that command are heard in time
        return result

    def call(self, name, kind=Trigger, request=None):
        """Call a service; return its answer.

        Called again where it does not come: the first answer to a new client is lost now and then, because
        the node has found the client's requests before it found where the answers go.
        """
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        client, answers = self._clients[name], []
        self.until(client.service_is_ready)

        def ask():
            answers.append(client.call_async(request or kind.Request()))

        ask()
        ask_again = every(AGAIN, ask)

        def answered():
            ask_again()
            return next((answer for answer in answers if answer.done()), None)

        return self.until(answered).result()

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
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown()


@pytest.fixture(scope="module")
def listener():
    """One listener for a module's tests."""
    node = Listener()
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


@pytest.fixture
def make_driver(listener):
    """A function that makes a driver in this process: name, values of its parameters; closed in the end."""
    made = []

    def make(name, values, overrides=()):
        node = LifecycleNode(name, namespace=name, parameter_overrides=list(overrides))
        made.append((driver.DriverNode(node, values), node))
        listener.serve(node)
        return made[-1]

    yield make
    for program, node in made:
        program.close()
        listener.drop(node)
