"""How a node runs and ends.

Through the shared memory of Fast DDS, `publish` waits a second or two, and keeps the interpreter, for one who
listens and was stopped (SIGSTOP) while taking a message out. And Fast DDS 3 asks a publisher for its type,
once: where the question comes too soon, the node never hears it. So nodes use sockets, and ask for no types.
"""

import errno
import faulthandler
import hashlib
import math
import os
import signal
import socket
import stat
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier, remove_ros_args

from rsea_ros.documents.wording import printable
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.nodes._parameters import NodeParameter, declare, usage
from rsea_ros.nodes._waiter import Pulse, anything_to_do
from rsea_ros.processes import ENDING, STOPPING, Stopped

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
LOCALHOST, AS_PROFILE = "LOCALHOST", "SYSTEM_DEFAULT"
"""Of RANGE: with the first rmw_fastrtps adds shared memory whatever else is said, with the second nothing."""
PROFILE = "FASTDDS_DEFAULT_PROFILES_FILE"
USERS = (PROFILE, "FASTRTPS_DEFAULT_PROFILES_FILE")
OLDER = ("humble", "iron")
"""Distributions whose Fast DDS does not read PROFILE: it would be open to the network."""
HERE = Path(__file__).with_name("localhost_sockets.xml")
"""Who may find the node is the same: this machine."""
ANYWHERE = HERE.with_name("sockets.xml")


def use_sockets() -> None:
    """Let nodes from now on send by sockets, and be found from this machine alone unless the user opens it.

    Who finds a node may command torque. A user's own profile of Fast DDS, and other middleware, stay.
    """
    os.environ.setdefault(RANGE, LOCALHOST)
    if any(name in os.environ for name in USERS) or os.environ.get("ROS_DISTRO") in OLDER:
        return
    if not get_rmw_implementation_identifier().startswith("rmw_fastrtps"):
        return
    if os.environ[RANGE] == LOCALHOST and PEERS not in os.environ and HERE.is_file():
        os.environ[RANGE], os.environ[PROFILE] = AS_PROFILE, str(HERE)
    else:
        os.environ[PROFILE] = str(ANYWHERE)
        os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")


NAMESPACE = "rsea"
SUCCESS, BAD_INPUT = 0, 2
TICK = 0.1
"""s between looks at whether to stop, and whether the program has finished."""


class Program(Protocol):
    """The work of a node beside its callbacks."""

    def is_finished(self) -> bool:
        """Return whether the work is done; raises the error of a thread. Default: run until stopped."""
        return False

    def conclude(self) -> None:
        """Finish after the work is done or was stopped; Ctrl-C interrupts this."""

    def close(self) -> None:
        """Clean up on every way out: torque zero, threads joined, files closed."""


@dataclass(frozen=True)
class Component:
    """A kind of node: its usual name, its parameters, and what makes its program from their values.

    endless: a signal of STOPPING is the regular end; any other end by a signal is an interruption (status
    128 plus its number).
    more: parameters beside those of the table, from the given ones.
    patience: s from a signal to an end by force, of a node that leaves nothing undone; told is where it was.
    """

    name: str
    table: Sequence[NodeParameter]
    make: Callable[[Any, dict[str, Any]], Program]
    kind: type[Node] = Node
    endless: bool = True
    more: Callable[[Mapping[str, Any]], Sequence[NodeParameter]] = lambda given: ()
    patience: float = math.inf

    def run(self) -> int:
        """Run one node in this process and return the exit status."""
        return run_nodes([self], own_arguments())


def own_arguments() -> list[str]:
    """Return the command line without ROS's arguments; nothing where ROS can't read them and will say so."""
    with suppress(RuntimeError):
        return list(remove_ros_args(sys.argv)[1:])
    return []


class Member:
    """A node of the package in an executor, until `close`: torque zero, threads joined, files closed.

    others: kinds of nodes in the same process, whose parameters are given to all. options: of rclpy's Node.
    """

    def __init__(
        self, component: Component, executor: Executor, *, name: str = "", namespace: str = NAMESPACE,
        others: Sequence[Component] = (), **options: Any,
    ) -> None:  # fmt: skip
        self._executor, options = executor, {"namespace": namespace, **options}
        options["automatically_declare_parameters_from_overrides"] = True
        try:
            self.node = component.kind(name or component.name, **options)
        except RuntimeError as error:  # of middleware that cannot, as with security that it does not have
            raise RseaError(str(error).split(", at /")[0]) from None
        with ExitStack() as kept:
            kept.callback(self.node.destroy_node)
            if component.kind is not Node:
                kept.enter_context(_claim(self.node))
            known = {p.name for other in others for p in other.table}
            values = declare(self.node, component.table, component.more, known)
            self.program = component.make(self.node, values)
            executor.add_node(self.node)
            self._kept = kept.pop_all()

    def close(self) -> None:
        """End it."""
        self.program.close()
        self._executor.remove_node(self.node)
        self._kept.close()


def _claim(node: Node) -> socket.socket:
    """Return what holds a node's name on this machine until it is closed, or the process is dead.

    Of two drivers of one name either answers a stop. Raises RseaError where another one has the name.
    """
    name, held = node.get_fully_qualified_name(), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    place = hashlib.sha256(f"{node.context.get_domain_id()} {name}".encode()).hexdigest()
    try:
        held.bind(f"\0rsea_ros {place}")  # of Linux: no file, and gone with whoever has it
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            held.close()
            raise RseaError(f"a node called {name} runs on this machine, expected none") from None
    return held


def run_nodes(components: Sequence[Component], arguments: Sequence[str] = ()) -> int:
    """Run nodes in this process and one executor and return the exit status.

    An error that the user can correct is one line in the log and status 2; what ends one node ends all.
    """
    if "--help" in arguments or "-h" in arguments:
        sys.stdout.write("\n".join(usage(each.name, each.table) for each in components))
        return SUCCESS
    stop, log = _Stop(), get_logger(components[0].name)
    patience, listener = max(each.patience for each in components), None
    if endless := all(each.endless for each in components):
        _wait_for_no_reader()
    try:
        if math.isfinite(patience):
            listener = SignalListener(partial(faulthandler.dump_traceback_later, patience, exit=True))
        _initialise(arguments)
        if effects := os.environ.get("RSEA_EFFECTS"):
            log.warning(f"RSEA_EFFECTS={printable(effects)}: code from there runs in this node")
        done = _work(sorted(components, key=lambda each: each.kind is Node), stop)  # drivers are first
        return SUCCESS if done or (endless and stop.status - Stopped.BASE in STOPPING) else stop.status
    except Stopped as stopped:
        return stopped.status
    except (RseaError, OSError) as error:
        log.fatal(printable(" ".join(str(error).split())))
        return BAD_INPUT
    finally:
        rclpy.try_shutdown()
        if listener is not None:
            listener.close()
            faulthandler.cancel_dump_traceback_later()


def _wait_for_no_reader() -> None:
    """Drop what a full pipe, or a terminal after Ctrl-S, does not take: it holds up cycle and answers."""
    for stream in (1, 2):
        with suppress(OSError):
            if os.isatty(stream):  # opened anew: a shell waits for the terminal as before
                own = os.open(f"/proc/self/fd/{stream}", os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
                os.dup2(own, stream)
                os.close(own)
            elif not stat.S_ISREG(os.fstat(stream).st_mode):
                os.set_blocking(stream, False)


class SignalListener:
    """Call `react()`, in a thread, at the first signal that ends the process, beside the handlers it has."""

    def __init__(self, react: Callable[[], None]) -> None:
        self._react = react
        self._outlet, self._inlet = os.pipe()
        os.set_blocking(self._inlet, False)
        self._main = threading.current_thread() is threading.main_thread()  # not permitted to other users
        if self._main:
            self._before = signal.set_wakeup_fd(self._inlet, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no more."""
        if self._inlet < 0:
            return
        if self._main:
            signal.set_wakeup_fd(self._before)
        os.close(self._inlet)
        self._inlet = -1
        self._thread.join()
        os.close(self._outlet)

    def _listen(self) -> None:
        while numbers := os.read(self._outlet, 64):
            if set(ENDING).intersection(numbers):
                self._react()


class _Stop:
    """A signal is only a request: the node publishes its zeros before it exits. Other handlers stay."""

    def __init__(self) -> None:
        self.status = 0
        self._numbers = [n for n in ENDING if n in STOPPING or signal.getsignal(n) is signal.SIG_DFL]
        for number in self._numbers:
            signal.signal(number, self._ask)

    @property
    def asked(self) -> bool:
        """Whether a signal has arrived."""
        return self.status > 0

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.status = Stopped(number).status

    def interrupt(self) -> None:
        """From now on signals raise Stopped."""
        for number in self._numbers:
            signal.signal(number, _raise)


def _raise(number: int, frame: FrameType | None) -> None:
    raise Stopped(number)


def _initialise(arguments: Sequence[str]) -> None:
    """Start ROS. Raises ParameterError for arguments that it cannot read."""
    if arguments:
        raise ParameterError(f"argument {arguments[0]!r}, expected --ros-args -p NAME:=VALUE (see --help)")
    use_sockets()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ParameterError(f"ROS arguments: {str(error).split(', at /')[0]}") from None


def _work(components: Sequence[Component], stop: _Stop) -> bool:
    """Spin until a program has finished or a signal requests a stop; return whether one had finished."""
    executor, members = SingleThreadedExecutor(), list[Member]()
    with ExitStack() as kept:
        kept.callback(executor.shutdown)
        kept.callback((pulse := Pulse(rclpy.get_default_context(), TICK)).close)
        kept.callback(_close, members)
        for each in reversed(components):  # which compute for seconds, before the first one moves a machine
            members.insert(0, Member(each, executor, others=components))
        nodes, done = [member.node for member in members], False
        while not (stop.asked or done):
            ready = anything_to_do(nodes, executor, pulse)
            done = max(member.program.is_finished() for member in members)
            if ready and not done:
                executor.spin_once(timeout_sec=0.0)
        stop.interrupt()
        for member in members:
            member.program.conclude()
        return done


def _close(members: Sequence[Member]) -> None:
    """Close each whatever another one raises, the first one first: it may move a machine."""
    with ExitStack() as kept:
        for member in reversed(members):
            kept.callback(member.close)
