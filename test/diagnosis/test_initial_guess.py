"""Where fits begin: lines, ripples, gains and limits that are put into signals are found in them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.diagnosis import initial_guess
from rsea_ros.diagnosis.initial_guess import (
    RecordView,
    angle_errors,
    initial_guesses,
    interpolate_peak,
    joint_guesses,
    peaks,
    ripples,
    sine_at,
    stated_starts,
)
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.unknowns import Unknown, start_vector
from rsea_ros.model.drive import Drive
from rsea_ros.model.inverse import Motion
from rsea_ros.model.rig_file import load_rig

RATE = 280.0
T = 5.0 + np.arange(4200) / RATE
RIG = load_rig("paper_high_impedance")


def drive(command=(1.0, -3.0, 2.0), spans=(), **at):
    made = Drive.__new__(Drive)
    for name, value in {"command": np.array(command), "spans": spans, "at": at, "start": 5.0}.items():
        object.__setattr__(made, name, value)
    return made


def case(driven=None, t=T, mask=None, **measured):
    y = {n: np.asarray(v, float) for n, v in measured.items()}
    return SimpleNamespace(
        start=5.0, t=dict.fromkeys(y, t), measured=y, drive=drive() if driven is None else driven,
        mask={n: np.ones(len(v), bool) if mask is None else mask for n, v in y.items()},
    )  # fmt: skip


@pytest.fixture(autouse=True)
def plain_residual(monkeypatch):
    monkeypatch.setattr(initial_guess, "residual_of", lambda c, outputs, n: c.measured[n] - outputs[n])


def view(given, rig=RIG, **outputs):
    return RecordView(given, rig, outputs)


def test_peaks_are_the_largest_that_lie_apart():
    level = np.zeros(40)
    level[[10, 13, 20, 30]] = [9.0, 8.0, 5.0, 4.0]
    assert peaks(level, 3) == [10, 20] and peaks(level, 2) == [10, 13] and peaks(level, 10) == [10, 30]
    assert peaks(np.zeros(5), 1) == [] and peaks(np.array([0.0, 2.0, 0.0]), 3) == [1]


def test_a_peak_of_a_parabola_of_logarithms_lies_where_it_was_put():
    bins = 0.25 * np.arange(9.0)
    level = np.exp(-((bins - 1.07) ** 2))
    assert interpolate_peak(bins, level, 4) == pytest.approx(1.07)
    assert interpolate_peak(bins, level, 0) == 0.0 and interpolate_peak(bins, level, 8) == 2.0
    level[3] = 0.0
    assert interpolate_peak(bins, level, 4) == 1.0


def test_a_sine_has_its_amplitude_and_phase():
    assert sine_at(T, 3.0 * np.sin(7.0 * T + 0.6), 7.0) == pytest.approx({"amplitude": 3.0, "phase": 0.6})
    found = view(case(ft=2.0 * np.sin(2.0 * math.pi * 9.0 * (T - 5.0) - 1.0)), ft=0.0 * T).sine("ft", 9.0)
    assert found == pytest.approx({"amplitude": 2.0, "phase": -1.0})


@pytest.mark.parametrize("is_sharp", [True, False])
def test_lines_of_a_residual_are_found_between_drift_and_half_the_rate(is_sharp):
    rng = np.random.default_rng(1)
    noise = 0.05 * rng.standard_normal(len(T))
    two = np.sin(2.0 * math.pi * 20.13 * T) + 0.6 * np.sin(2.0 * math.pi * 61.4 * T)
    outside = 5.0 * np.sin(2.0 * math.pi * 0.4 * T) + 5.0 * np.sin(2.0 * math.pi * 139.0 * T)
    shown = view(case(ft=two + outside + noise), ft=0.0 * T).lines("ft", is_sharp)
    assert shown == pytest.approx([20.13, 61.4], abs=0.01 if is_sharp else 0.1)
    near = np.sin(2.0 * math.pi * 20.0 * T) + 0.6 * np.sin(2.0 * math.pi * 21.0 * T) + noise
    found = view(case(ft=near), ft=0.0 * T).lines("ft", is_sharp)
    assert (found[1] == pytest.approx(21.0, abs=0.05)) == is_sharp
    keep = rng.random(len(T)) > 0.2
    lost = view(case(t=T[keep], ft=(two + noise)[keep]), ft=0.0 * T[keep]).lines("ft", is_sharp)
    assert lost[0] == pytest.approx(20.13, abs=0.15)


def rotor(cycles, amplitude, phase, ratio, position):
    return amplitude * np.sin(cycles * ratio * position + phase)


POSITION = 0.2 * np.sin(1.3 * T) + 0.05 * np.sin(4.1 * T + 1.0)


def test_a_ripple_over_the_rotor_is_found_with_its_cycles_amplitude_and_phase(monkeypatch):
    ratio = RIG["gear.ratio"]
    torque = rotor(6.26, 2.0, 0.7, ratio, POSITION) + rotor(11.0, 1.2, -0.4, ratio, POSITION) + 5.0
    torque = torque + 0.1 * np.random.default_rng(2).standard_normal(len(T))
    monkeypatch.setattr(initial_guess, "torque_along", lambda *a: (POSITION, torque))
    first, second = ripples(case(position=POSITION), RIG, {})
    assert first == pytest.approx({"cycles_per_revolution": 6.26, "amplitude": 2.0, "phase": 0.7}, rel=0.05)
    assert second == pytest.approx({"cycles_per_revolution": 11.0, "amplitude": 1.2, "phase": -0.4}, rel=0.1)
    for cycles in (0.4, 61.0):  # slower than a half and faster than sixty are none
        strong = 9.0 * np.sin(cycles * ratio * POSITION)
        monkeypatch.setattr(initial_guess, "torque_along", lambda *a, y=strong + torque: (POSITION, y))
        found = ripples(case(position=POSITION), RIG, {})
        assert all(abs(one["cycles_per_revolution"] - cycles) > 0.1 for one in found)
    short = 5e-4 * POSITION  # not two periods of the fastest
    monkeypatch.setattr(initial_guess, "torque_along", lambda *a: (short, rotor(4.0, 2.0, 0.0, ratio, short)))
    assert ripples(case(position=short), RIG, {}) == []
    monkeypatch.setattr(initial_guess, "torque_along", lambda *a: None)
    assert ripples(case(position=POSITION), RIG, {}) == []


def test_along_a_filtered_motion_the_sine_is_filtered_alike():
    ratio, t = RIG["gear.ratio"], np.arange(8000) / 1000.0
    q = 0.3 * np.sin(1.1 * t)
    motion = Motion(t, q, q, q, q, np.ones(8000, bool))
    true = initial_guess.smooth(rotor(4.0, 2.0, 0.5, ratio, q), 1e-3)
    measured = np.zeros(8000)
    given = case(motion, t=t, motor_torque=measured)
    found = ripples(given, RIG, {"motor_torque": true})[0]
    assert found == pytest.approx({"cycles_per_revolution": 4.0, "amplitude": 2.0, "phase": 0.5}, rel=0.1)


def test_an_error_of_the_angle_repeats_with_the_rotor():
    ratio = initial_guess.train_ratio(RIG)
    simulated = POSITION - 1e-4 * np.sin(5.0 * ratio * POSITION + 0.3) - 0.01
    found = angle_errors(case(position=POSITION), RIG, {"position": simulated})[0]
    assert found == pytest.approx({"cycles_per_revolution": 5.0, "amplitude": 1e-4, "phase": 0.3}, rel=0.05)
    assert angle_errors(case(ft=POSITION), RIG, {"ft": POSITION}) == []
    still = Motion(T, T, T, T, T, T > 0.0)
    assert angle_errors(case(still, position=POSITION), RIG, {"position": simulated}) == []


def test_what_a_record_shows_of_its_channels():
    torque = np.append(np.full(4199, -2.0), 50.0)
    given = case(drive((1.0, -3.0, 2.0)), position=POSITION, motor_torque=torque)
    seen = view(given, position=2.0 * POSITION, ft=T)
    assert seen.channels == ("position", "ft") and seen.measured == {"position", "motor_torque"}
    assert seen.travel() == pytest.approx(np.ptp(POSITION)) and view(case(ft=T)).travel() is None
    assert seen.largest_command() == 3.0
    assert view(case(Motion(T, T, T, T, T, T > 0.0), ft=T)).largest_command() is None
    assert seen.largest_motor_torque() == 2.0 and view(case(ft=T)).largest_motor_torque() is None
    assert seen.gain("position") == pytest.approx(0.5) and seen.gain("velocity") is None
    assert view(given, position=0.0 * T).gain("position") is None
    half = case(position=np.where(T < 10.0, POSITION, 9.0), mask=T < 10.0)
    assert view(half, position=POSITION).gain("position") == pytest.approx(1.0)
    assert seen.value("gear.ratio") == RIG["gear.ratio"] and seen.rigid_spring is RIG.rigid_spring
    assert seen.free == tuple(RIG.free()) and seen.is_joint is False
    narrow = SimpleNamespace(spread=lambda name: {"a": initial_guess.WELL_KNOWN, "b": 0.51}[name])
    assert view(given, narrow).is_well_known("a") and not view(given, narrow).is_well_known("b")


def test_a_command_without_an_answer_is_one_of_which_the_motor_shows_less_than_a_share():
    at = np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    driven = drive((1.0, -6.0, 3.0, 8.0), motor_torque=at)
    shown = np.array([0.6, -2.9, 2.0, 0.0, 8.0])
    given = case(driven, t=T[:5], motor_torque=shown, mask=np.array([True, True, True, False, True]))
    assert view(given).largest_unanswered_command(0.5) == 6.0
    assert view(given).largest_unanswered_command(0.4) == 0.0
    assert view(given).largest_unanswered_command(0.7) == 6.0
    assert view(case(driven, ft=T)).largest_unanswered_command(0.5) is None


def test_a_joints_torques_bound_its_guesses():
    friction, limit = effect_named("stribeck_friction"), effect_named("torque_saturation")
    sizes = [g[friction.main.name] for g in joint_guesses(friction, 2.0)]
    assert sizes == pytest.approx([0.06, 0.2, 0.6])
    ratio = [g[n] / friction.typical[n] for g in joint_guesses(friction, 2.0)
             for n in (p.name for p in friction.parameters if p.unit == "N m")]  # fmt: skip
    shares = np.array([0.06, 0.2, 0.6]) / friction.main.typical
    assert ratio == pytest.approx(np.repeat(shares, len(ratio) // 3))
    assert [g[limit.main.name] for g in joint_guesses(limit, 2.0)] == pytest.approx([1.4, 1.8, 2.0])
    assert len(joint_guesses(limit, 1e9)) == 1
    joint = SimpleNamespace(case=None, rig=None, rigid_spring=True, is_joint=True)
    assert initial_guesses(effect_named("nonlinear_spring"), joint) == []


def test_a_fit_may_begin_at_the_values_that_the_rig_states():
    effect = effect_named("backlash")
    gap = f"backlash.{effect.main.name}"
    unknowns = [Unknown("spring.stiffness", 1500.0, "1", 1.0, 1e5, False, 0.1, 1.0),
                Unknown("clock.ft", 0.1, "s", -1.0, 1.0, False, 0.1, 1.0),
                Unknown(gap, effect.main.typical, "rad", 0.0, 1.0, False, np.inf, 1.0)]  # fmt: skip
    rig = SimpleNamespace(free=lambda: ("spring.stiffness",))
    problem = SimpleNamespace(unknowns=tuple(unknowns), rig=rig)
    found = stated_starts(problem, np.array([900.0, 0.3, 0.5]), effect)
    assert len(found) == len(effect.default_guesses)
    expected = [[1500.0, 0.3, guess[effect.main.name]] for guess in effect.default_guesses]
    assert np.array(found) == pytest.approx(np.array(expected)) and start_vector(unknowns)[0] == 1500.0
