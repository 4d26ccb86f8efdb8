"""What the driver reports, whom it obeys, and how a step of the system clock affects the real process."""

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from rclpy.executors import SingleThreadedExecutor

from msg_adapters.ros import JointState, torque_command_message
from rsea_ros.nodes._commands import Obeyed
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes._run import SignalListener
from rsea_ros.nodes._waiter import Pulse, anything_to_do
from test.nodes.clock_shim import preload, set_clock
from test.nodes.conftest import as_argument
from test.nodes.on_wire import Driven
from test.nodes.stalls import is_stall
from test.nodes.warm import Bench

ROOT = Path(__file__).resolve().parents[2]
TRIES = 10
DRIVER = "import sys\nfrom rsea_ros.nodes.driver import main\nsys.exit(main())\n"


class Shimmed(Driven):
    """A driver in a process of its own whose system clock the test sets, and commands by that clock."""

    joint = "left_knee"

    def __init__(self, bench, listener, folder):
        self.listener, self.off, self.step = listener, 0, folder / "step"
        self.set_clock(0)
        start = {"autostart": True, "resume": True, "joint": self.joint, "baud": 4_000_000}
        super().__init__(bench, listener, "honest", partial(self._begin, folder), start)
        listener.until(self._clear.service_is_ready)

    def _begin(self, folder, name, remaps, **parameters):
        words = [w for k, v in parameters.items() for w in ("-p", f"{k}:={as_argument(v)}")]
        process = subprocess.Popen(
            [sys.executable, "-c", DRIVER, "--ros-args", *words, "-r", "__ns:=/honest"],
            env={**os.environ, "PYTHONPATH": str(ROOT), **preload(folder, self.step)},
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
        process.output = []
        return process

    def stamp(self):
        """Now, by the clock of the driver, ns."""
        return time.time_ns() + self.off

    def set_clock(self, by):
        """Set the process's system clock by so many seconds against the true one."""
        self.off = by * 10**9
        set_clock(self.step, self.off)

    def settled(self, key):
        """A number of a status that is published from now on."""
        self.health.clear()
        return int(self.listener.until(lambda: self.value(key)))

    def told(self, text):
        """Whether any status has said so in its summary."""
        return any(text in s.message for m in self.health for s in m.status if s.name == "/honest/driver")

    def drive(self, driven=lambda: True):
        """Command 10 N m until the motor has a torque and `driven` holds; clear what is latched."""
        self.trigger("clear_fault")
        self.push(lambda: driven() and self.goal()[0] != 0, mend=partial(self.trigger, "clear_fault"))


@pytest.fixture(scope="module")
def driver(tmp_path_factory, listener):
    """One for the tests of this module, in their order."""
    folder = tmp_path_factory.mktemp("honest")
    with Bench(folder / "tty") as bench:
        made = Shimmed(bench, listener, folder)
        yield made
        made.process.kill()
        made.process.wait()


def test_a_step_of_the_system_clock_ends_the_torque_and_is_reported(driver):
    """The clock goes an hour back, and nobody commands any more.

    On a machine that stalls the commands may have ceased for 50 ms before the step: then again.
    """
    for _ in range(TRIES):
        driver.set_clock(0)
        driver.drive()
        steps = driver.settled("clock_steps")
        driver.drive()
        driver.set_clock(-3600)
        driver.listener.until(lambda: driver.goal()[0] == 0)
        fault = driver.listener.until(lambda: (fault := driver.value("fault")) != "none" and fault)
        assert driver.settled("clock_steps") == steps + 1
        if fault.startswith("clock_step"):
            break
        assert is_stall(fault) or fault.startswith("command_timeout"), fault
    assert fault == "clock_step: the system clock was set by -3600.000 s", fault
    driver.set_clock(0)
    driver.drive()


def test_wrong_stamps_are_reported(driver):
    driver.off = 10 * 10**9
    driver.health.clear()
    driver.push(lambda: driver.told("commands with a stamp that is off"), torque=30.0)
    driver.off = 0
    assert float(driver.value("furthest_stamp_s")) == pytest.approx(10.0, abs=0.1)


def test_of_two_publishers_the_first_is_obeyed_until_it_is_silent():
    obeyed, second = Obeyed(), 10**9
    assert obeyed.admit("a", 0) and not obeyed.admit("b", second // 10) and obeyed.admit("a", second // 5)
    assert obeyed.ignored == 1
    assert obeyed.admit("b", second) and not obeyed.admit("a", second + 1)


def test_a_publisher_for_another_joint_keeps_nobody_from_commanding(driver):
    """Its messages were refused, and yet it was the one that was obeyed."""
    other = driver.listener.node.create_publisher(JointState, "/honest/torque_command", COMMAND)

    def beside():
        other.publish(torque_command_message(time.time_ns(), -30.0, "right_knee"))
        return driver.bench.torque()[0] > 0

    driver.listener.until(lambda: driver.value("ignored_commands"))
    begun, before = time.monotonic(), int(driver.value("ignored_commands"))
    while time.monotonic() - begun < 0.6:  # the first that is heard
        beside()
        time.sleep(0.01)
    driver.drive(beside)
    driver.listener.node.destroy_publisher(other)
    assert int(driver.value("ignored_commands")) == before


def test_a_signal_acts_while_the_main_thread_waits(listener):
    """The handler ran only after the wait, 95 ms later."""
    reacted = threading.Event()
    before = signal.signal(signal.SIGHUP, lambda number, frame: None)
    alarm = SignalListener(reacted.set)
    sender = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGHUP))
    late = threading.Timer(0.1, lambda: order.append(reacted.wait(20.0)))
    order = []
    pulse, executor = Pulse(listener.node.context, 0.5), SingleThreadedExecutor()
    try:
        sender.start()
        late.start()
        while not order:
            anything_to_do([listener.node], executor, pulse)
        assert order == [True]
    finally:
        pulse.close()
        executor.shutdown()
        alarm.close()
        signal.signal(signal.SIGHUP, before)


def test_simulated_time_is_refused(start):
    process = start("driver", use_sim_time=True)
    assert process.wait() == 2
    assert "use_sim_time = true, expected false" in process.output[-1]


def test_a_driver_whose_clock_was_set_back_ends_at_ctrl_c(driver):
    """The middleware's waits of 0.1 s lasted an hour longer: the last test here, for it ends the driver."""
    driver.set_clock(0)
    driver.drive()
    driver.set_clock(-3600)
    driver.process.send_signal(signal.SIGINT)
    assert driver.process.wait(20.0) == 0
    assert driver.bench.torque() == (0, False)
