"""The plant over topics: stamps on its grid, commands act from their stamps, zero torque when they cease."""

import signal
import time

import numpy as np
import pytest

from msg_adapters.ros import (
    DiagnosticArray,
    JointState,
    WrenchStamped,
    joint_state_of,
    stamp_of,
    time_of,
    torque_command_message,
)
from rsea_ros.nodes._commands import WATCHDOG
from rsea_ros.nodes._cycle import SECOND
from rsea_ros.nodes._qos import COMMAND, MEASUREMENT

RATE = 250.0
PERIOD = SECOND / RATE
LEAD = SECOND // 5
"""How far ahead a command is sent, ns: a machine that is busy with other tests may stall for so long."""
TRIALS = 5


class Bench:
    """The plant's topics as seen from outside."""

    def __init__(self, start, listener):
        self.process = start("plant", rate=RATE, noise=False)
        self.listener = listener
        self.states = listener.hear(JointState, "/rsea/joint_states", MEASUREMENT)
        self.wrenches = listener.hear(WrenchStamped, "/rsea/ft", MEASUREMENT)
        self.health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
        self.commands = listener.node.create_publisher(JointState, "/rsea/torque_command", COMMAND)
        listener.until(lambda: self.states and self.commands.get_subscription_count())

    def after(self, stamp, count=1):
        """Wait for measurements after a stamp and return (stamp, motor torque) of all since it."""
        newer = [joint_state_of(m) for m in self.states if stamp_of(m.header.stamp) > stamp]
        if len(newer) < count:
            want = len(self.states) + count
            self.listener.until(lambda: len(self.states) >= want)
            return self.after(stamp, count)
        return [(s[0], s[3]) for s in newer]

    def rest(self):
        """Wait until the watchdog has zeroed what another test commanded."""
        self.listener.until(lambda: self.states[-1].effort[0] == 0.0)

    def now(self):
        """Stamp of the newest measurement, ns."""
        return stamp_of(self.states[-1].header.stamp)

    def command(self, torque):
        """Send a command for an instant ahead that is a measurement's, and return that instant."""
        periods = np.ceil((time.time_ns() + LEAD - self.now()) / PERIOD)
        effect = self.now() + round(periods * PERIOD)
        self.commands.publish(torque_command_message(effect, torque))
        return effect

    def mistimed(self):
        """Return how many commands the plant says have not acted at their stamps, until now."""
        asked = time.time_ns()
        self.listener.until(lambda: self.health and stamp_of(self.health[-1].header.stamp) > asked)
        values = _values(self.health[-1])
        return int(values["late_commands"]) + int(values["unstamped_commands"])

    def punctual(self, trial):
        """Return what a trial shows; again when a stall made its command late, which the plant counts."""
        for _ in range(TRIALS):
            before = self.mistimed()
            shown = trial()
            if self.mistimed() == before:
                return shown
        raise AssertionError(f"{TRIALS} trials, and in each a command came after its stamp")


@pytest.fixture(scope="module")
def bench(start, listener):
    """One plant for all tests of this module."""
    return Bench(start, listener)


def test_stamps_are_even_and_lie_in_the_past(bench):
    bench.listener.until(lambda: len(bench.states) >= 200)
    stamps = np.array([stamp_of(m.header.stamp) for m in bench.states])
    cycles = (stamps - stamps[0]) / PERIOD
    assert cycles == pytest.approx(np.round(cycles), abs=1e-6)
    assert np.all(np.diff(np.round(cycles)) == 1)
    assert stamps[-1] < time.time_ns()


def test_ft_has_the_stamps_of_the_states(bench):
    bench.listener.until(lambda: len(bench.wrenches) >= 50)
    bench.after(stamp_of(bench.wrenches[-1].header.stamp))
    stamps = {stamp_of(m.header.stamp) for m in bench.states}
    assert {stamp_of(m.header.stamp) for m in bench.wrenches[1:]} <= stamps
    assert all(m.wrench.force.x == 0.0 for m in bench.wrenches)


def test_a_command_acts_from_its_stamp_on(bench):
    def trial():
        bench.rest()
        effect = bench.command(12.0)
        return effect, bench.after(effect - round(4 * PERIOD), 8)[:8]

    effect, seen = bench.punctual(trial)
    assert [torque for _, torque in seen] == [12.0 if stamp > effect + 1 else 0.0 for stamp, _ in seen]
    assert {torque for _, torque in seen} == {0.0, 12.0}


def test_a_command_without_a_stamp_acts_on_arrival(bench):
    bench.rest()
    before = bench.now()
    message = torque_command_message(0, -7.0)
    message.header.stamp = time_of(0)
    bench.commands.publish(message)
    bench.listener.until(lambda: bench.states[-1].effort[0] == -7.0)
    assert bench.now() > before


def test_the_watchdog_zeroes_the_torque_when_commands_cease(bench):
    """However late the command was: the watchdog counts in the plant's own time."""
    bench.rest()
    effect = bench.command(9.0)
    bench.listener.until(lambda: bench.states[-1].effort[0] == 9.0)
    bench.rest()
    held = [stamp for stamp, torque in bench.after(effect) if torque == 9.0]
    assert held[-1] - held[0] == pytest.approx(WATCHDOG, abs=2 * PERIOD)


def test_impossible_commands_change_nothing_and_are_reported(bench):
    bench.rest()
    two = torque_command_message(0, 5.0)
    two.name, two.effort = ["a", "b"], [5.0, 5.0]
    bench.commands.publish(two)
    bench.commands.publish(torque_command_message(0, float("nan")))
    count = len(bench.states)
    told = bench.listener.until(lambda: _values(bench.health[-1]).get("refused_commands") == "2")
    assert told and all(m.effort[0] == 0.0 for m in bench.states[count:])
    assert any("2 joints (a, b), expected one" in line for line in bench.process.output)


def test_diagnostics_give_period_and_command_age(bench):
    values = _values(bench.listener.until(lambda: bench.health)[-1])
    assert {"period_mean_ms", "period_p99_ms", "period_max_ms", "missed_cycles", "command_age_ms"} <= set(
        values
    )
    assert float(values["period_mean_ms"]) > 0.0


def test_sigterm_ends_the_plant_with_status_0(bench):
    assert bench.process.stop(signal.SIGTERM) == 0


def _values(message):
    """Key and value of a node's status."""
    return {pair.key: pair.value for pair in message.status[0].values}
