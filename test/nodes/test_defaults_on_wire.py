"""Faults on the wire with the defaults of config/nodes; the other tests there have patient limits.

How long a torque acts is counted in the driver's writes, from the bench's log: no machine stretches that. A
machine that stalls latches faults of its own with these limits: then the trial is repeated.
"""

import os
import signal
import subprocess
import threading
import time

import pytest
from lifecycle_msgs.msg import Transition

from test.nodes.on_wire import Driven
from test.nodes.stalls import is_stall
from test.nodes.warm import Bench

TRIALS = 12
SECOND, MOST_STUCK = 280, 90


class Commanded(Driven):
    """A driver that a thread commands at 280 Hz. torque: N m; None: nothing."""

    stamp = staticmethod(time.time_ns)

    def __init__(self, bench, listener, name, begin):
        super().__init__(bench, listener, name, begin, {"autostart": True})
        self.torque, self.children, self._over = 10.0, (), threading.Event()
        self._thread = threading.Thread(target=self._command, daemon=True)
        self._thread.start()

    def _command(self):
        while not self._over.wait(1.0 / SECOND):
            if self.torque is not None:
                self.publish(self.torque)

    def close(self):
        """Command no more."""
        self._over.set()
        self._thread.join()

    def ready(self):
        """Wait until the motor has all of its torque and no fault is latched; find the driver's processes.

        A search for them takes ten cycles on a busy machine, and the fault is to come at once.
        """
        self.torque = 10.0

        def drive():
            if self.latched():
                self.clear()
            self._activate()
            return self.goal() == (self.counts(10.0), True) and not self.latched()

        self._listener.until(drive)
        found = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True)
        self.children = tuple(int(pid) for pid in found.stdout.split())

    def clear(self):
        """Clear the fault, by a reboot or from the start where that is necessary; return the answers.

        From the start: the bench's position jumped while a stall let no cycle see it, and jumped back.
        """
        answers = [self.trigger("clear_fault")]
        if any(words in answers[0].message for words in ("cleanup and configure", "is not configured")):
            for transition in ("DEACTIVATE", "CLEANUP", "CONFIGURE"):
                self.change(getattr(Transition, f"TRANSITION_{transition}"))
            answers.append(self.trigger("clear_fault"))
        if not answers[0].success and "expected a reboot" in answers[0].message:
            answers.append(self.trigger("reboot"))
        self.health.clear()
        return answers


@pytest.fixture(scope="module")
def wire(tmp_path_factory, start, listener):
    with Bench(tmp_path_factory.mktemp("defaults") / "tty", "--ft-rate", 1000) as bench:
        bench.hurry()
        made = Commanded(bench, listener, "defaults", start)
        yield made
        made.close()


def ask(what, **values):
    return lambda wire: wire.bench.ask(what, **values)


def silence(wire):
    wire.torque = None


def rename(wire):
    wire.bench.ask("vanish")
    wire.bench.ask("appear", name="another")


def back(wire):
    assert not wire.trigger("clear_fault").success
    wire.bench.ask("vanish")
    wire.bench.ask("appear")


def supervisor(number):
    return lambda wire: [os.kill(pid, number) for pid in wire.children]


CALM = ask("misbehave", silent=False, drop=0.0, delay=0.0, twin=False, ft_silent=False, ft_stuck=False)
HEALTHY = ask("set", temperature=32, voltage=240, mode=0, homing_offset=0, baud=3)
MOVED = ("effort", "motor_state", "velocity", "deflection", "ft_torque")
FAULTS = {
    "no reply": (ask("misbehave", silent=True), CALM, "no_reply", 5),
    "every reply 20 ms late": (ask("misbehave", delay=1.0, late=0.02), CALM, "no_reply", 5),
    "hot": (ask("set", temperature=71), HEALTHY, "temperature", 2),
    "supply too low": (ask("set", voltage=190), HEALTHY, "voltage", 2),
    "torque switched off": (ask("set", torque_enable=0), HEALTHY, ("effort", "motor_state"), 3),
    "mode changed": (ask("set", mode=3), HEALTHY, ("effort", "motor_state"), SECOND),
    "mode changed, turning": (ask("set", mode=1, goal_velocity=3000), HEALTHY, MOVED, SECOND),
    "position jumps": (ask("set", homing_offset=40_000), HEALTHY, "position_step", 3),
    "alert": (ask("alert", bits=32), HEALTHY, "hardware_error", 3),
    "F/T saturated": (ask("ft_status"), ask("ft_status", bits=0), "ft", 3),
    "F/T silent": (ask("misbehave", ft_silent=True), CALM, "ft", 8),
    "F/T stands still": (ask("misbehave", ft_stuck=True), CALM, "ft: all six values", MOST_STUCK),
    "two motors of one ID": (ask("misbehave", twin=True), CALM, "no_reply", 8),
    "bit rate of the motor changed": (ask("set", baud=1), HEALTHY, "no_reply", None),
    "adapter under a new name": (rename, back, "portlost", None),
    "F/T rate falls to 50 Hz": (ask("ft_rate", rate=50.0), ask("ft_rate", rate=1000.0), "ft", 60),
    "F/T restarted": (ask("ft_restart"), CALM, "ft", 90),
    "commands cease": (silence, CALM, "command_timeout", 25),
    "supervisor killed": (supervisor(signal.SIGKILL), CALM, "supervisorlost", 8),
    "supervisor stands still": (supervisor(signal.SIGSTOP), CALM, "supervisorlost", SECOND),
}
"""How it is provoked and ended, the cause that is latched, the most writes of a torque until then.

None: no write reaches the motor, which holds its torque until it hears again (docs/hardware.md).
"""


def test_a_driver_that_starts_under_a_stream_of_commands_makes_no_torque_by_itself(wire, listener):
    """One that was killed and started again did. Then commands during the activation kept it inactive."""
    fault = listener.until(wire.latched)
    listener.until(lambda: wire.value("active") == "True")
    told = "restarted: the first torque since autostart, 10 N·m, came 0 s after the first command"
    assert fault.startswith(told) or is_stall(fault)
    assert not any(goal and on for _, goal, on in wire.bench.log()["torque"])


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_ends_the_torque_within_its_cycles_and_is_over_by_its_service(wire, listener, name):
    provoke, end, cause, most = FAULTS[name]
    for _ in range(TRIALS):
        wire.ready()
        before, asked = wire.bench.ask("torque"), provoke(wire)
        since = (asked if isinstance(asked, dict) else before)["t"]
        fault = listener.until(wire.latched)
        listener.until(lambda: 0 in wire.goal() or most is None)
        writes = [goal != 0 and on for _, goal, on in wire.bench.log(since)["torque"]]
        end(wire)
        if fault.startswith(cause):
            break
        seen_first = "off: ft" in fault  # by spring and motor: ft stood still before its torque was there
        assert is_stall(fault) or seen_first or fault.startswith("command_timeout"), fault
    assert fault.startswith(cause)
    acted = max((at for at, acts in enumerate(writes, 1) if acts), default=0)
    assert most is None or acted <= most, writes
    listener.until(lambda: wire.clear()[-1].success)
    wire.ready()


def test_a_stop_while_a_clear_waits_for_the_sensor_holds_until_a_later_clear(wire, listener):
    """It was acknowledged and forgotten: when the clear was over, 10 N m acted."""
    for _ in range(4):
        wire.ready()
        wire.bench.ask("misbehave", ft_silent=True)
        listener.until(wire.latched)
        clear = wire.request("clear_fault")
        while not clear.done() and "until clear_fault" not in wire.trigger("stop").message:
            pass  # the stop is asked for again
        waits = not clear.done()
        CALM(wire)
        answer = listener.until(lambda clear=clear: clear.done() and clear.result())
        if waits and "stop was called meanwhile" in answer.message:
            break  # else the stop was served first, and this clear ended it; or the bench stood still
    assert "stop was called meanwhile" in answer.message
    since = wire.bench.ask("torque")["t"]
    wire.health.clear()
    fault = listener.until(wire.latched)
    assert fault.startswith("stopped") or is_stall(fault), fault
    assert not any(goal and on for _, goal, on in wire.bench.log(since)["torque"])


@pytest.mark.parametrize(
    ("happens", "undone", "confirmed"),
    [
        (ask("set", mode=1, goal_velocity=3000), HEALTHY, True),
        (ask("vanish"), ask("appear"), False),
    ],
)
def test_a_stop_says_whether_the_motor_has_confirmed_it(wire, listener, happens, undone, confirmed):
    """It was "torque zero" with 6.8 N·m in another mode, and with a port that was away."""
    wire.ready()
    happens(wire)
    answer, on = wire.trigger("stop"), wire.goal()[1]
    assert answer.success == confirmed == (not on), answer.message
    assert ("the motor is off" if confirmed else "cut its power") in answer.message
    undone(wire)
    listener.until(lambda: wire.clear()[-1].success)


@pytest.mark.parametrize("service", ["clear_fault", "reboot"])
def test_another_motor_of_the_same_id_is_not_switched_on(wire, listener, service):
    wire.ready()
    wire.bench.ask("set", temperature=90)
    listener.until(wire.latched)
    since = wire.bench.ask("set", temperature=32, torque_limit=500)["t"]
    answers = []

    def is_told():
        answers.append(wire.trigger(service))
        return answers[-1].success or "no reply" not in answers[-1].message  # as of a bench that stalls

    listener.until(is_told)
    assert not answers[-1].success and "expected 9.99" in answers[-1].message
    assert not any(on and goal for _, goal, on in wire.bench.log(since)["torque"]) and not wire.goal()[1]
    wire.bench.ask("set", torque_limit=620)


def test_the_first_torque_after_a_fault_is_small(wire):
    wire.ready()
    assert wire.trigger("stop").success
    since = wire.bench.ask("torque")["t"]
    assert not any(goal for _, goal, _ in wire.bench.log(since)["torque"])
    wire.clear()
    wire.ready()
    torques = [abs(goal) for _, goal, on in wire.bench.log(since)["torque"] if goal and on]
    assert torques[0] <= wire.counts(500.0 / SECOND) + 1, "soft_start, N m/s"
