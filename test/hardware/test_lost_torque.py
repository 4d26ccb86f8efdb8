"""A motor that loses its torque, its host or its supervisor, on the wire."""

import fcntl
import os
import pty
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware import supervisor
from rsea_ros.hardware.device import PortLost
from rsea_ros.hardware.dynamixel.bus import SerialPort
from rsea_ros.hardware.protection import ANSWER, SupervisorLost
from test.hardware.conftest import Loop, well_behaved
from test.nodes.stalls import until

ROOT = Path(__file__).resolve().parents[2]
SECOND = 280
"""Cycles."""


@pytest.mark.parametrize(
    ("loop", "register"),
    [(54024, "torque_enable"), (54025, "watchdog"), ("DM8009", "torque_enable"), ("RS03", "torque_enable")],
    indirect=["loop"],
)
def test_registers_that_the_torque_depends_on_are_read_once_a_second(loop, register):
    loop.bench.ask("set", **{register: 0})
    loop.until_fault(10.0, most=2 * SECOND)
    assert loop.guarded.fault.cause == "motor_state"
    assert loop.bench.torque() == (0, False)
    loop.guarded.clear()
    loop.cycles(3, 10.0)
    assert loop.guarded.fault is None and loop.bench.torque()[1]


@pytest.mark.parametrize("loop", (54024, "AK10-9"), indirect=True)
def test_a_motor_behind_an_adapter_that_is_back_is_switched_off_before_anybody_clears(loop):
    """It went on with its last goal, also after a stop and a deactivation that were answered with success.

    And the cycles of all joints of its driver stood still for a second: those on other ports lost theirs.
    """
    loop.cycles(20, 8.0)
    loop.bench.ask("vanish")
    begun = time.monotonic()
    loop.until_fault(8.0)
    assert time.monotonic() - begun < ANSWER
    assert loop.bench.torque()[0] != 0
    loop.bench.ask("appear")
    for _ in range(40):
        loop.cycles(10, 8.0)
        if loop.bench.torque() == (0, False):
            break
    assert loop.bench.torque() == (0, False)
    assert loop.guarded.fault.cause == "portlost"
    loop.guarded.clear()
    assert loop.cycles(3, 8.0) == [8.0] * 3


@pytest.mark.parametrize("loop", (54024, "DM8009"), indirect=True)
def test_a_motor_absent_at_one_clear_fault_can_be_cleared_at_the_next(loop):
    """After an emergency stop the port was opened again but the motor not set up: 'not open' for ever."""
    loop.bench.ask("misbehave", silent=True)
    loop.until_fault(10.0)
    loop.bench.ask("vanish")
    loop.cycles(2, 10.0)
    loop.bench.ask("appear")
    for _ in range(2):
        with pytest.raises(DeviceError):
            loop.guarded.clear()
    loop.bench.ask("misbehave", silent=False)
    loop.guarded.clear()
    assert loop.acts(10.0)


@pytest.fixture
def service(tmp_path):
    """A supervisor that runs apart, as its unit file starts it; its socket."""
    path = tmp_path / "supervisor"
    words = [sys.executable, supervisor.__file__, "--listen", path]
    process = subprocess.Popen(words, start_new_session=True)
    until(path.exists)
    yield path
    process.kill()
    process.wait()


DRIVER = """
import sys
sys.path.insert(0, "test/hardware")
from conftest import Loop
class Bench:
    port, ft_port, page_port = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    model = int(sys.argv[5]) if sys.argv[5].isdigit() else sys.argv[5]
loop = Loop(Bench, supervisor=sys.argv[4])
loop.guarded.enable()
while True:
    loop.cycle(10.0)
"""


def command(bench, supervised, **options):
    """Start a driver of a bench as the first process of a session; return it."""
    words = ["-c", DRIVER, bench.port, bench.ft_port, bench.page_port, supervised, bench.model]
    return subprocess.Popen([sys.executable, *map(str, words)], cwd=ROOT, start_new_session=True, **options)


def kill(drivers, first=lambda: None):
    """Wait until drivers make their torque; kill each with its children at once, and wait for its end."""
    try:
        until(lambda: all(bench.torque()[0] != 0 and bench.torque()[1] for bench, _ in drivers))
    finally:
        first()
        for _, driver in drivers:
            os.killpg(driver.pid, signal.SIGKILL)
            driver.wait()
    until(lambda: all(bench.torque() == (0, False) for bench, _ in drivers))


def test_a_supervisor_service_zeroes_the_torque_when_a_whole_process_group_is_killed(benches, service):
    """Driver, its children and its session are killed at once, as by a service manager or a container."""
    each = [benches(model) for model in (54024, "AK10-9")]
    for bench in each:
        well_behaved(bench)
    kill([(bench, command(bench, service)) for bench in each])


def test_the_drivers_own_supervisor_outlives_a_login_that_is_killed(benches):
    """Its terminal hangs up, and everything started from it is killed."""
    well_behaved(bench := benches())
    near, far = pty.openpty()
    terminal = dict.fromkeys(("stdin", "stdout", "stderr"), far)
    login = command(bench, "", preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0), **terminal)
    os.close(far)
    kill([(bench, login)], first=lambda: os.close(near))
    until(lambda: _is_free(bench.port))  # the supervisor has it until it ends


def test_a_supervisor_service_releases_the_port_and_its_death_is_a_fault(benches, service):
    bench = benches()
    well_behaved(bench)
    for _ in range(2):
        loop = Loop(bench, supervisor=str(service))
        loop.guarded.enable()
        loop.cycles(5, 10.0)
        assert loop.guarded.fault is None
        loop.close()
        assert bench.torque() == (0, False)


def test_a_supervisor_service_that_does_not_run_is_refused(benches, tmp_path):
    well_behaved(benches())
    with pytest.raises(SupervisorLost, match="expected a supervisor that listens there"):
        Loop(benches(), supervisor=str(tmp_path / "nobody"))


def _is_free(path):
    port = SerialPort(path, 4_000_000, 0.01)
    try:
        port.open()
    except PortLost:
        return False
    port.close()
    return True
