"""The model node without its process: inputs that stand still, its flag and its report."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from bench.observer.truth import true_run
from msg_adapters.ros import (
    JointState,
    WrenchStamped,
    joint_state_message,
    torque_command_message,
    wrench_message,
)
from rsea_ros.model.observer import Observer, noise_of
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes._health import OK, WARN
from rsea_ros.nodes._joint_inputs import Frozen, InputSettings, ModelInputs, StoppedSensors
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes.model import UNMOVED, ModelHealth

RIG = load_rig("paper_high_impedance")
READ = InputSettings(0.02, "torque.z", True)
EPOCH, PERIOD = 1_700_000_000_000_000_000, 1e9 / 280.0


def publish(publishers, k, command, state, torque=None):
    """Publish sample k: command, (position, effort) and torque, None without ft."""
    stamp = round(EPOCH + k * PERIOD)
    publishers["torque_command"].publish(torque_command_message(stamp, command))
    publishers["joint_states"].publish(joint_state_message(stamp, state[0], 0.0, state[1]))
    if torque is not None:
        publishers["ft"].publish(wrench_message(stamp, (0.0,) * 5 + (torque,)))


def feed(listener, inputs, publishers, samples):
    """Publish samples and return the estimates."""
    estimates = []
    for start in range(0, len(samples), 20):
        some, before = samples[start : start + 20], len(estimates)
        for k, sample in enumerate(some, start):
            publish(publishers, k, *sample)

        def has_arrived():
            estimates.extend(estimate for _, estimate in inputs.take())
            return len(estimates) >= before + len(some) or inputs.stopped.ft_frozen  # noqa: B023  called at once

        listener.until(has_arrived)
    return estimates


@pytest.fixture
def inputs_of(listener):
    """A function that makes inputs and publishers of their topics."""
    made = []

    def make(**more):
        node = listener.node
        inputs = ModelInputs(node, Observer(RIG), StoppedSensors(noise_of(RIG), **more), READ)
        kinds = {"torque_command": JointState, "joint_states": JointState, "ft": WrenchStamped}
        made.extend(node.create_publisher(kind, topic, COMMAND) for topic, kind in kinds.items())
        publishers = dict(zip(kinds, made[-3:], strict=True))
        listener.until(lambda: all(each.get_subscription_count() for each in publishers.values()))
        return inputs, publishers

    yield make
    for publisher in made:
        listener.node.destroy_publisher(publisher)


def test_a_value_with_noise_that_stands_still_has_stopped_and_may_go_on():
    ft = Frozen()
    assert not any(ft.take(round(k * PERIOD), (0.01 * (k % 3),)) for k in range(100))
    assert [ft.take(round((100 + k) * PERIOD), (1.0,)) for k in range(30)][-1]
    assert not ft.take(round(130 * PERIOD), (1.1,))


def test_a_joint_at_rest_is_no_fault_until_its_torque_moves():
    joint = Frozen(least=0.3)
    for k in range(100):
        joint.beside(0.02 * (-1) ** k)
        assert not joint.take(round(k * PERIOD), (0.1, 0.0))
    for k in range(100, 130):
        joint.beside(0.05 * (k - 100))
        stopped = joint.take(round(k * PERIOD), (0.1, 0.0))
    assert stopped


def test_a_few_equal_samples_are_chance():
    ft = Frozen()
    assert not any(ft.take(round(k * PERIOD), (float(k // 8),)) for k in range(200))


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_the_estimate_follows_ft_as_soon_as_joint_states_stand_still(listener, inputs_of, noise):
    """It was 18 N m off, and under noise of its own for as long as they stood, then ft was named for it."""
    inputs, publishers = inputs_of(stiffness=RIG["spring.stiffness"])
    count, stop = 500, 180
    run = true_run(RIG, 10.0 * np.sin(10.0 * math.pi * np.arange(count) / 280.0), 280.0, seed=1)
    command, position, effort, ft = (
        run.record[n].y.copy() for n in ("command", "position", "motor_torque", "ft")
    )
    dice = np.random.default_rng(2).standard_normal((2, count - stop))
    position[stop:] = position[stop] + noise * noise_of(RIG).position * dice[0]
    effort[stop:] = effort[stop] + noise * noise_of(RIG).motor_torque * dice[1]
    states = zip(position.tolist(), effort.tolist(), strict=True)
    samples = list(zip([*command[1:], 0.0], states, ft.tolist(), strict=True))
    estimates = feed(listener, inputs, publishers, samples)
    off = np.abs(np.array([each.distal for each in estimates]) - run.distal)
    assert off[stop:].max() < 1.5 and off[stop + 28 :].max() < 0.15
    assert inputs.stopped.frozen == ["joint_states"]


def test_a_torque_that_is_no_number_is_none(listener, inputs_of):
    """The flag of pure torque stayed up over 1.8 s of NaN: the sensor had spoken."""
    inputs, publishers = inputs_of()
    feed(listener, inputs, publishers, [(0.0, (0.0, 0.0), 0.01 * k) for k in range(20)])
    assert not inputs.ft_silent
    for k, torque in enumerate([math.nan] * 15 + [1e300] * 15, 20):
        publish(publishers, k, 0.0, (0.0, 0.0), torque)
    listener.until(lambda: [*inputs.take()] and inputs.refused >= 30)
    assert inputs.ft_silent


def test_a_topic_that_falls_silent_is_waited_for_only_so_long(listener, inputs_of, monkeypatch):
    monkeypatch.setattr("rsea_ros.nodes._joint_inputs.PATIENCE", 0.2)
    inputs, publishers = inputs_of()
    feed(listener, inputs, publishers, [(0.0, (0.0, 0.0), 0.01 * k) for k in range(20)])
    for k in range(20, 60):  # the others go on
        publish(publishers, k, 0.0, (1e-5 * k, 0.0))
    listener.until(lambda: [*inputs.take()] and inputs.ft_silent)


def test_states_that_stand_still_while_commands_move_are_noticed(listener, inputs_of):
    """Both sensors had stopped, the one under its own noise, and the flag stayed up."""
    inputs, publishers = inputs_of()
    torques = [0.0] * 60 + [8.0 * math.sin(0.1 * k) for k in range(60)]
    samples = [(u, (0.001, 0.1), 1.0 + 0.01 * (-1) ** k) for k, u in enumerate(torques)]
    feed(listener, inputs, publishers, samples[:60])
    assert not inputs.stopped.unmoved
    feed(listener, inputs, publishers, samples)
    assert inputs.stopped.unmoved and inputs.stopped.frozen == []


def test_a_torque_from_an_encoder_may_stand_still_as_long_as_the_joint_does(listener, inputs_of):
    """Of a machine at rest it was said that its sensor had stopped."""
    inputs, publishers = inputs_of(ft_repeats=True, stiffness=RIG["spring.stiffness"])
    still = [(0.0, (0.001, 0.0), 1.53)] * 60
    feed(listener, inputs, publishers, still)
    assert inputs.stopped.frozen == []
    moving = [(0.0, (0.001 + 1e-4 * k, 0.0), 1.53) for k in range(60)]
    feed(listener, inputs, publishers, [*still, *moving])
    assert inputs.stopped.frozen == ["ft"]


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


def reported(**changes):
    """Return the report of a node whose parts say what is given."""
    node = Node(10.0, lambda t, torque: torque)
    health = node.health
    health.estimate = SimpleNamespace(
        sigma_distal=0.1234, sigma_proximal=0.2, disturbance=1.5, sigma_disturbance=0.75
    )
    health._inputs = SimpleNamespace(**{**vars(node.inputs), "ft_age": 0.0125, "refused": 3, "unstamped": 4,
                                        **changes.pop("inputs", {})})  # fmt: skip
    edge = SimpleNamespace(hz=12.345, low=11.0, high=14.0)
    health._error = SimpleNamespace(
        verdict="pure", share=0.0321, edge=edge, torque=5.0, settings=SimpleNamespace(tolerance=0.1)
    )
    health._torque_band = SimpleNamespace(
        edge=20.0, occupied=lambda: SimpleNamespace(hz=3.5, share_above=0.25),
        error_at=lambda hz: (hz, -2.0 * hz),
    )  # fmt: skip
    tests = changes.pop("tests", {})
    health._observer = SimpleNamespace(late=5, refused=6, restarts=7, consistency=lambda: tests)
    health._eq_7 = 88.0
    return health, health.report()


def looked(ratio, broken):
    return SimpleNamespace(ratio=ratio, limit=1.5, broken=broken, mean=0.01)


def test_a_report_says_what_all_of_its_parts_say():
    _, report = reported(tests={"ft": looked(1.25, False)})
    assert (report.level, report.summary) == (OK, "pure")
    assert report.values == {
        "verdict": "pure", "tolerance": "0.1", "error_share": "0.0321", "error_edge_hz": "12.35",
        "error_edge_low_hz": "11.00", "error_edge_high_hz": "14.00", "bandwidth_hz": "20.00",
        "eq_7_hz": "88.00", "occupied_hz": "3.50", "share_above": "0.2500", "gain_error_db": "3.50",
        "phase_error_deg": "-7.0",
        "sigma_distal": "0.1234", "sigma_proximal": "0.2", "disturbance": "1.5", "sigma_disturbance": "0.75",
        "ft_age_ms": "12.5", "late_samples": 5, "too_late_samples": 6, "refused_messages": 3,
        "unstamped_commands": 4, "restarts": 7, "ft.innovation": "1.250", "ft.innovation_limit": "1.500",
        "ft.innovation_mean": "0.01",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tests": {"ft": looked(2.0, True)}},
         "model inconsistent with ft: innovations 2.00 times theirs (limit 1.50)"),
        ({"inputs": {"stopped": SimpleNamespace(frozen=["ft"], unmoved=True)}},
         "ft repeats one value: the sensor has stopped"),
        ({"inputs": {"stopped": SimpleNamespace(frozen=[], unmoved=True)}}, UNMOVED),
        ({"inputs": {"ft_silent": True}},
         "no ft for 0.01 s: estimated without it, sigma of the distal torque 0.123 N·m"),
    ],
)  # fmt: skip
def test_a_report_warns_of_each_trouble(changes, said):
    _, report = reported(**changes)
    assert (report.level, report.summary) == (WARN, said)


def test_a_sensor_off_by_more_than_is_tolerated_contradicts():
    """Tolerated: a tenth of 5 N m, of innovations whose noise is 0.2 N m."""
    health, _ = reported()
    health._errors = {"ft": 0.2, "position": 0.2}
    tests = {"ft": looked(2.6, True), "position": looked(2.4, True)}
    assert health._contradictions(tests) == [
        "ft differs from model and other sensors by 0.52 N·m RMS, limit 0.5 N·m"
    ]
    assert health._contradictions({"ft": looked(2.6, False)}) == []
    health._error.share = math.nan
    assert health._contradictions(tests) == []


def test_the_band_learns_the_noise_where_it_has_settled_or_changed():
    health, _ = reported(inputs={"period": 0.01})
    learnt = []
    health._torque_band = SimpleNamespace(calibrate=lambda error, period: learnt.append((error, period)))
    health._observer = SimpleNamespace(error_model=lambda period: f"error at {period}")
    for sigma, period in ((0.1, 0.01), (0.109, 0.0109), (0.112, 0.01), (0.112, 0.0112), (0.112, math.nan)):
        health._inputs.period = period
        health._calibrate(sigma)
    assert learnt == [("error at 0.01", 0.01), ("error at 0.01", 0.01), ("error at 0.0112", 0.0112)]
