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
from rsea_ros.nodes.model import UNMOVED, ModelHealth

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
