"""The observer on simulated benches: its stated uncertainty holds for samples in any order and rhythm."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from bench.observer.lacks import actuators, measure, played
from bench.observer.truth import true_run
from rsea_ros.errors import RigError
from rsea_ros.model.observer import Observer, noise_of, observe
from rsea_ros.model.observer.transition import transition
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import lumped_rig

RATE = 280.0
SETTLE = 100
RIGS = ("paper_high_impedance", "paper_moving_output")
CASES = (
    "nothing", "friction, stated", "play", "K_s 5 % more", "F/T noise 5 times", "free housing, friction",
    "samples late",
)  # fmt: skip
"""What the model lacks; `python -m bench observer lacks` plays more, longer."""


def rms(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def chirp(seconds, amplitude=8.0):
    """A chirp of 0.5 to 40 Hz with white noise, N m."""
    t = np.arange(round(seconds * RATE)) / RATE
    phase = 2.0 * np.pi * (0.5 * t + 39.5 / seconds / 2.0 * t**2)
    return amplitude * np.sin(phase) + 3.0 * np.random.default_rng(1).standard_normal(len(t))


@pytest.fixture(scope="module")
def moving():
    """A run of the moving-output bench, and its truth."""
    return true_run(load_rig("paper_moving_output"), chirp(3.0), RATE, seed=2)


def test_transitions_are_those_of_van_loan():
    rng = np.random.default_rng(0)
    a, half = 30.0 * rng.standard_normal((5, 5)), rng.standard_normal((5, 5))
    walk, t, f, q = half @ half.T, 0.02, np.empty((5, 5)), np.empty((5, 5))
    transition(a, walk, np.ones(5), t, f, q)
    block = expm(np.block([[-a, walk], [np.zeros((5, 5)), a.T]]) * t)
    assert f == pytest.approx(block[5:, 5:].T, rel=1e-9, abs=1e-9)
    assert q == pytest.approx(block[5:, 5:].T @ block[:5, 5:], rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("name", RIGS)
def test_the_unlumped_observer_errs_as_it_says_and_the_lumped_one_much_more(name):
    rig = load_rig(name)
    truth = true_run(rig, chirp(3.0), RATE, seed=2)
    _, estimates = observe(Observer(rig), truth.record)
    for error, sigma in ((estimates[:, 0] - truth.distal, estimates[:, 3]),
                         (estimates[:, 1] - truth.proximal, estimates[:, 4])):  # fmt: skip
        assert rms((error / sigma)[SETTLE:]) < 1.9
    _, rival = observe(Observer(lumped_rig(rig)), truth.record)
    ends = np.column_stack([truth.distal, truth.proximal])
    unlumped_error, lumped_error = (rms((e[:, :2] - ends)[SETTLE:]) for e in (estimates, rival))
    assert unlumped_error < 0.01 and 100.0 * unlumped_error < lumped_error


def test_the_order_of_arrival_changes_nothing(moving):
    """With commands early and samples up to 60 ms late and out of order, the last estimate is the same."""
    rig, record = load_rig("paper_moving_output"), moving.record
    in_order = observe(Observer(rig), record)[1][-1]
    rng, observer, arrivals = np.random.default_rng(3), Observer(rig), []
    for name in ("command", "position", "ft"):
        for t, y in zip(record[name].t, record[name].y, strict=True):
            early, late = (0.1, 0.0) if name == "command" else (0.0, 0.06)
            arrivals.append((t + rng.uniform(-early, late), t, name, y))
    torque = dict(zip(record["motor_torque"].t, record["motor_torque"].y, strict=True))
    for _, t, name, y in sorted(arrivals):
        if name == "command":
            observer.command(t, y)
        elif name == "position":
            last = observer.state(t, y, torque[t])
        else:
            observer.ft(t, y)
    last = observer.ft(record["ft"].t[-1], np.nan)
    assert observer.late > 100 and observer.refused == 0
    assert last[:3] == pytest.approx(in_order[:3], abs=2e-4)


def test_without_ft_the_doubt_grows_and_its_return_is_no_surprise(moving):
    observer = Observer(load_rig("paper_moving_output"))
    record, gone = moving.record, (1.5, 1.8)
    before = during = after = None
    for k, t in enumerate(record["ft"].t):
        observer.command(record["command"].t[k], record["command"].y[k])
        if gone[0] < t < gone[1]:
            during = observer.state(t, np.nan)
            continue
        held = observer.state(t, record["position"].y[k])
        after = observer.ft(t, record["ft"].y[k])
        if during is None:
            before = after
        elif t < gone[1] + 1.5 / RATE:
            assert abs(held.distal - moving.distal[k]) < 3.0 * held.sigma_distal
            assert abs(after.distal - held.distal) < 3.0 * held.sigma_distal
            assert abs(after.proximal - held.proximal) < 3.0 * held.sigma_proximal
    assert during.sigma_distal > 1.5 * before.sigma_distal
    assert after.sigma_distal < 1.05 * before.sigma_distal


def test_the_innovation_test_names_the_channel_and_passes_a_right_model(moving):
    rig = load_rig("paper_moving_output")
    softer = rig.with_values({"spring.stiffness": 0.9 * rig["spring.stiffness"]})
    right, wrong = Observer(rig), Observer(softer)
    for observer in (right, wrong):
        observe(observer, moving.record)
    assert not any(channel.broken for channel in right.consistency().values())
    told = wrong.consistency()
    assert told["ft"].broken and told["ft"].ratio > 2.0 and not told["motor_torque"].broken


@pytest.mark.parametrize("case", CASES)
def test_the_torque_is_never_worse_than_the_sensor_and_lies_within_its_sigma(case):
    """On plants of another hand; 93 to 97 % in long runs."""
    for actuator in actuators().values():
        error, sensor, inside = measure(actuator, case, 3.0, (1,))
        assert error < 1.05 * sensor and inside > 0.92
        assert error < 0.25 * sensor or case not in ("nothing", "friction, stated", "F/T noise 5 times")
        assert inside < 0.98 or case.startswith(("free", "samples late"))


def test_friction_that_the_model_lacks_is_in_the_disturbance_within_50_ms():
    for actuator in actuators().values():
        t = np.arange(round(3.0 * actuator.rate)) / actuator.rate
        command = actuator.size[0] * np.sin(2.0 * np.pi * 3.0 * t)
        run = played(actuator.clamped, command, actuator.rate, 4, friction=actuator.friction)
        d = observe(Observer(actuator.clamped), run.record)[1][:, 2]
        slides, back = np.abs(run.friction) > 0.9 * actuator.friction, round(0.05 * actuator.rate)
        since = [k for k in range(len(t) // 6, len(t)) if slides[k - back : k + 1].all()]
        told = d[since] / run.friction[since]
        assert len(told) > 0.1 * len(t) and np.quantile(told, 0.05) > 0.7 and 0.95 < told.mean() < 1.05


def test_samples_that_no_sensor_gives_leave_no_trace(moving):
    """Nothing is nan for ever: not after nan, infinity, a wild value, or a sensor that gives zeros only."""
    rig, rate = load_rig("paper_moving_output"), 1.0 / RATE
    observer, record = Observer(rig), moving.record
    for k in range(300):
        observer.state(k * rate - 10.0, 0.0, 0.0)
        assert np.isfinite(observer.ft(k * rate - 10.0, 0.0)).all()
    for k, t in enumerate(record["ft"].t):
        wild = {200: math.nan, 220: math.inf, 240: 1e4, 260: -1e300}.get(k, 0.0)
        observer.command(t - rate, record["command"].y[k])
        observer.state(t, record["position"].y[k] + (wild if k < 250 else 0.0), wild)
        estimate = observer.ft(t, record["ft"].y[k] + wild)
        assert np.isfinite(estimate).all()
        assert k < 400 or abs(estimate.proximal - moving.proximal[k]) < 0.15


def test_a_drive_that_does_not_follow_its_command_is_believed_for_its_current():
    rig = load_rig("paper_high_impedance")
    truth = true_run(rig.with_effect("torque_saturation", limit=4.0), chirp(3.0), RATE, seed=2)
    observer = Observer(rig)
    _, estimates = observe(observer, truth.record)
    assert observer.consistency()["motor_torque"].broken
    assert rms((estimates[:, 0] - truth.distal)[SETTLE:]) < 0.03
    assert rms(estimates[SETTLE:, 2]) < 0.2


def test_another_run_starts_afresh(moving):
    observer = Observer(load_rig("paper_moving_output"))
    first = observe(observer, moving.record)[1]
    again = observe(observer, moving.record)[1]
    assert observer.restarts == 1 and again == pytest.approx(first)


def test_gains_come_from_what_identification_measured():
    rig = load_rig("paper_high_impedance")
    quiet = noise_of(rig)
    assert quiet.ft == rig.sensors["ft"].noise
    assert quiet.disturbance == pytest.approx(np.hypot(0.05, 0.109989 / np.sqrt(12.0)))
    assert 1.0 / quiet.tau == pytest.approx(2.0 * np.pi * 6.365, rel=0.01)
    told = noise_of(rig, {"ft": 0.3, "position": 1e-4}, {"ft": 0.5})
    assert (told.ft, told.position, told.disturbance) == (0.3, 1e-4, pytest.approx(0.4))
    with pytest.raises(RigError, match=r"sensors\.ft\.noise = 0 N·m, expected > 0"):
        noise_of(replace(rig, sensors={"ft": Sensor()}))


def test_the_lines_of_the_page_run_as_they_stand():
    page = (Path(__file__).resolve().parents[2] / "docs" / "observer.md").read_text(encoding="utf-8")
    said = {}
    exec(page.split("```python\n")[1].split("```")[0], said)
    assert said["estimate"].distal == pytest.approx(said["sample"].ft, abs=0.15)
