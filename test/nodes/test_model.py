"""model on real topics: a bag by replay, F/T that drops out, and a flag that rises and falls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.observer.truth import true_run
from msg_adapters import write_record
from msg_adapters.ros import (
    Bool,
    DiagnosticArray,
    JointState,
    WrenchStamped,
    joint_state_message,
    stamp_of,
    torque_command_message,
    wrench_message,
)
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._qos import COMMAND, LATCHED, RECORD_RELIABLE
from test.nodes.on_wire import newest_status

RIG = "paper_moving_output"
RATE = 280.0
EPOCH = 1_700_000_000_000_000_000
CONTRACT = {"bandwidth_hz", "occupied_hz", "share_above", "gain_error_db", "phase_error_deg"}


def sine(f, amplitude, seconds):
    """A sine, N m."""
    return amplitude * np.sin(2.0 * np.pi * f * np.arange(round(seconds * RATE)) / RATE)


@pytest.fixture(scope="module")
def truth():
    """Two seconds at 20 Hz, below the edge, then two in which the pendulum swings on."""
    command = np.concatenate([sine(20.0, 12.0, 2.0), np.zeros(round(2.0 * RATE))])
    return true_run(load_rig(RIG), command, RATE, seed=4)


def edge_of_a_moving_output():
    """Lowest, nominal and highest Hz of J w^2 = 0.3 |K_s + i b_s w - J w^2| over 90 % of b_s and J_m.

    The housing is the distal end of this rig, so T_d is the torque with the chassis' inertia in it.
    """
    sigma, k_s = 1.6449 * np.array([-1.0, 0.0, 1.0]), 1530.456
    b, j_m = np.meshgrid(3.0 * np.exp(0.5 * sigma), 0.953 * np.exp(0.15 * sigma))
    j = 0.0040 + j_m / 502
    square, linear = (1.0 - 0.09) * j**2, 0.09 * (2.0 * k_s * j - b**2)
    w2 = (np.sqrt(linear**2 + 0.36 * square * k_s**2) - linear) / (2.0 * square)
    hz = np.sqrt(w2) / (2.0 * np.pi)
    return [hz.min(), hz[1, 1], hz.max()]


class Heard:
    """What the node publishes."""

    def __init__(self, listener):
        self.estimates = listener.hear(JointState, "/rsea/torque_estimate", RECORD_RELIABLE)
        self.flags = listener.hear(Bool, "/rsea/pure_torque", LATCHED)
        self._health = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)

    def status(self):
        """The newest status of the node."""
        return newest_status(self._health, "/rsea/model")

    def values(self):
        """Its values."""
        return {v.key: v.value for v in self.status().values} if self.status() else {}


@pytest.fixture(scope="module")
def heard(start, listener):
    """The node, running and heard."""
    heard = Heard(listener)
    heard.process = start("model", rig=RIG, reliable=True)
    listener.until(lambda: heard.flags and listener.node.count_publishers("/rsea/torque_estimate"))
    return heard


def test_a_bag_replayed_gives_an_estimate_for_each_wrench_as_good_as_it_says(
    heard, truth, start, listener, tmp_path
):
    write_record(replace(truth.record, epoch_ns=EPOCH), tmp_path / "run.mcap")
    replay = start("replay", bag=tmp_path / "run.mcap", rate=200.0, start=0.251)
    samples = truth.record["ft"].t[:-1]  # a command may follow the last
    asked = EPOCH + np.rint(samples[samples > 0.251 + truth.record["command"].t[0]] * 1e9).astype(np.int64)
    listener.until(lambda: len(heard.estimates) >= len(asked))
    assert replay.wait() == 0, replay.output
    assert list(heard.estimates[0].name) == ["distal", "proximal", "disturbance"]
    stamps = [stamp_of(m.header.stamp) for m in heard.estimates[: len(asked)]]
    assert np.setdiff1d(asked, stamps).tolist() == [] and stamps == asked.tolist()
    efforts = np.array([m.effort for m in heard.estimates[100 : len(asked)]])
    for k, true in enumerate((truth.distal, truth.proximal)):
        assert np.abs(efforts[:, k] - true[-len(efforts) - 1 : -1]).max() < 0.05


def test_the_flag_is_latched_for_late_subscribers(heard, listener):
    listener.until(lambda: heard.flags[-1].data)
    assert not heard.flags[0].data
    values = listener.until(lambda: heard.values().keys() >= CONTRACT and heard.values())
    assert float(values["bandwidth_hz"]) == pytest.approx(57.04, abs=0.01)
    assert float(values["eq_7_hz"]) == pytest.approx(53.20, abs=0.01)
    edges = [float(values[f"error_edge{which}_hz"]) for which in ("_low", "", "_high")]
    assert edges == pytest.approx(edge_of_a_moving_output(), abs=0.01)
    late = listener.node.create_subscription(Bool, "/rsea/pure_torque", (flags := []).append, LATCHED)
    listener.until(lambda: flags)
    listener.node.destroy_subscription(late)
    assert [m.data for m in flags] == [True]


def test_the_estimate_survives_a_loss_of_ft_and_its_return_without_a_jump(heard, truth, listener):
    node, begin = listener.node, EPOCH + 100_000_000_000
    topics = (("torque_command", JointState), ("joint_states", JointState), ("ft", WrenchStamped))
    command, state, ft = (node.create_publisher(kind, f"/rsea/{t}", RECORD_RELIABLE) for t, kind in topics)
    listener.until(lambda: all(p.get_subscription_count() for p in (command, state, ft)))
    heard.estimates.clear()
    record = truth.record
    stamps = begin + np.rint(record["ft"].t * 1e9).astype(np.int64)

    def wrench_of(k):
        return wrench_message(int(stamps[k]), (0.0,) * 5 + (float(record["ft"].y[k]),))

    def play(samples, with_ft=True):
        for k in samples:
            command.publish(torque_command_message(int(stamps[k]), record["command"].y[k + 1]))
            values = (record[n].y[k] for n in ("position", "velocity", "motor_torque"))
            state.publish(joint_state_message(int(stamps[k]), *values))
            if with_ft:
                ft.publish(wrench_of(k))

    def newest(k):
        """Wait for the estimate at a sample and return it."""
        listener.until(lambda: any(stamp_of(m.header.stamp) == stamps[k] for m in heard.estimates))
        return next(m.effort[0] for m in heard.estimates if stamp_of(m.header.stamp) == stamps[k])

    play(range(300))
    newest(299)
    listener.until(lambda: heard.flags[-1].data)
    play(range(300, 400), with_ft=False)
    ft.publish(wrench_of(419))  # a later one: nothing of the time between need be waited for
    assert newest(399) == pytest.approx(truth.distal[399], abs=0.06)
    listener.until(lambda: not heard.flags[-1].data)
    told = listener.until(lambda: heard.status() and "no ft for" in heard.status().message and heard.values())
    assert heard.status().level == b"\x01" and float(told["sigma_distal"]) > 0.004
    doubt = float(told["sigma_distal"])
    play(range(400, 419))
    assert newest(400) == pytest.approx(truth.distal[400], abs=3.0 * doubt)
    assert doubt < 0.1


def test_sigint_ends_the_node_with_status_0_and_the_flag_down(heard, listener):
    assert heard.process.stop() == 0
    listener.until(lambda: not heard.flags[-1].data)
