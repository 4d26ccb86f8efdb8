"""What the model node says of its sensors: one that contradicts the others takes the flag away."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.model.observer import Observer, noise_of
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes._health import OK, WARN
from rsea_ros.nodes._model_health import UNMOVED, ModelHealth

RIG = load_rig("paper_high_impedance")
RATE, NOISE = 280.0, noise_of(RIG)


class Node:
    """The model node without ROS. sensed: what the F/T sensor makes of the torque at a time (s)."""

    def __init__(self, amplitude, sensed):
        self._observer, self._error = Observer(RIG, hold=0.05), ErrorFlag(RIG)
        self.inputs = SimpleNamespace(
            stopped=SimpleNamespace(frozen=[], unmoved=False), ft_silent=False, ft_age=0.0, refused=0,
            unstamped=0, period=math.nan,
        )
        self.health = ModelHealth(RIG, NOISE, self._observer, TorqueBand(RIG), self._error, self.inputs)
        self._amplitude, self._sensed, self._k = amplitude, sensed, 0
        self.freezes = False
        self._rng = np.random.default_rng(3)

    def run(self, seconds):
        """Play and return the report."""
        self.play(seconds)
        return self.health.report()

    def play(self, seconds):
        """Play a slow sine, at which the spring has the torque of the motor."""
        for _ in range(round(seconds * RATE)):
            t = self._k / RATE
            torque = self._amplitude * math.sin(2.0 * math.pi * 0.5 * t)
            if not self.freezes:
                self._stood = torque
            position = self._stood / RIG["spring.stiffness"] + NOISE.position * self._rng.normal()
            self._observer.command(t, torque)
            self._observer.state(t, position, torque)
            estimate = self._observer.ft(t, self._sensed(t, torque) + NOISE.ft * self._rng.normal())
            self._error.take(t, estimate, heard=True)
            self.health.tell(estimate)
            self._k += 1


def test_a_sound_sensor_contradicts_nobody():
    node = Node(8.0, lambda t, torque: torque)
    node.run(3.0)
    report = node.run(1.0)
    assert node.health.contradictions == [] and report.values["verdict"] == "pure"


@pytest.mark.parametrize(
    "wrong", [lambda t, torque: torque if t < 3.5 else -8.0, lambda t, torque: -torque if t > 3.0 else torque]
)
def test_a_sensor_that_keeps_an_old_value_under_its_own_noise_contradicts(wrong):
    """No value was ever repeated, and the flag stayed up while the estimate was wrong by 18 N m."""
    node = Node(8.0, wrong)
    node.run(3.0)
    assert node.health.contradictions == []
    node.run(1.0)
    report = node.run(1.0)
    assert report.level == WARN and "ft differs from model and other sensors by" in report.summary
    assert node.health.contradictions


def test_joint_states_that_stand_still_beside_a_live_ft_contradict_within_two_windows():
    """They outvoted it for 0.98 s, with the flag up and an estimate that was wrong by 6.9 N m."""
    node = Node(8.0, lambda t, torque: torque)
    node.run(3.1)
    assert node.health.contradictions == []
    node.freezes = True
    late = 0.0
    while not node.health.contradictions:
        node.play(1.0 / RATE)
        late += 1.0 / RATE
        assert late < 2.0 * 0.25
    assert "differs from model and other sensors" in node.health.contradictions[0]


@pytest.mark.parametrize("amplitude", [0.0, 0.01])
def test_a_torque_too_small_to_judge_is_not_compared(amplitude):
    """The noise of every sensor is more than the tolerated part of a hundredth of a N m."""
    node = Node(8.0, lambda t, torque: torque)
    node.run(2.0)
    node._amplitude = amplitude
    node.run(2.0)
    assert node.run(1.0).level == OK and node.health.contradictions == []
    assert node._error.verdict == "pure", "a finer detector still hears it"


def test_states_that_do_not_follow_the_commands_are_reported():
    node = Node(8.0, lambda t, torque: torque)
    node.run(2.0)
    node.inputs.stopped.unmoved = True
    assert UNMOVED in node.health.report().summary
