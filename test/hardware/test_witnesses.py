"""ft beside K times deflection and motor torque: zero point and gain under torque."""

import math
from collections import deque
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rsea_ros.control.controller import TorqueController
from rsea_ros.control.following import reading
from rsea_ros.control.law import Gains
from rsea_ros.hardware.device import Spring, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.simulated import SECOND, SimulatedDevice
from rsea_ros.hardware.witnesses import Actuator, Witnesses
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.nodes import _control, driver
from rsea_ros.nodes._devices import limits_of, spring_of, witnesses_of

RATE = 280.0
RIG, FREE = "paper_high_impedance", "paper_moving_output"
WAVES = {
    "hold": lambda t, dice: 1.0,
    "sine": lambda t, dice: math.sin(2.0 * math.pi * 2.0 * t),
    "fast": lambda t, dice: math.sin(2.0 * math.pi * 12.0 * t),
    "step": lambda t, dice: 1.0 if t % 2.0 < 1.0 else -1.0,
    "noise": lambda t, dice: np.clip(0.4 * dice.standard_normal(), -1.0, 1.0),
    "pulses": lambda t, dice: 1.0 if t % 0.6 < 0.4 else 0.0,
    "rest": lambda t, dice: 0.0,
}


def bench(rig, plant=None, rate=RATE):
    """The driver's device on a simulated plant, a clock for it, and the device."""
    values = {p.name: p.default for p in driver.TABLE} | {"rig": rig, "rate": rate, "soft_start": 1e5}
    now = [1_700_000_000 * SECOND]
    device = SimulatedDevice(plant or load_rig(rig), rate, clock=lambda: now[0])
    guarded = GuardedDevice(
        device, limits_of(values), rate, spring_of(values), testify=partial(witnesses_of, values)
    )
    guarded.open()
    guarded.enable()
    return guarded, now, device


def play(guarded, now, wave, torque, seconds, *, until_fault=False, rate=RATE):
    """Play a wave until something is told or the time is over; return what was told and the time, s."""
    dice = np.random.default_rng(0)
    for k in range(round(seconds * rate)):
        now[0] += round(SECOND / rate)
        guarded.cycle(torque * WAVES[wave](k / rate, dice), 0.0)
        if guarded.fault or (guarded.contradiction and not until_fault):
            break
    return guarded.contradiction, k / rate


def test_a_reading_of_no_actuator_is_no_witness():
    """A position of 1e155 rad ended the controller with an OverflowError."""
    guarded, _, _ = bench(RIG)
    witnesses = guarded._testify(guarded._rating)
    for k in range(400):
        state = State(round(k * SECOND / RATE), 0.005, 0.0, 8.0, 0, (0.0,) * 5 + (7.65,))
        assert witnesses.take(replace(state, position=1e155) if k == 300 else state, 8.0) is None
    assert not witnesses.words


def falsify(device, monkeypatch, gain=1.0, bias=0.0):
    read = device.read

    def false():
        state = read()
        return replace(state, wrench=(*state.wrench[:5], gain * state.wrench[5] - bias))

    monkeypatch.setattr(device, "read", false)


@pytest.mark.parametrize(
    ("wave", "torque", "wrong", "most"),
    [
        ("sine", 10.0, {"bias": -8.0}, 0.05),
        ("noise", 27.0, {"bias": 12.0}, 0.2),
        ("hold", 10.0, {"gain": 0.5}, 0.1),
        ("sine", 10.0, {"gain": -1.0}, 0.15),
        ("step", 10.0, {"gain": 2.0}, 0.1),
        ("pulses", 20.0, {"bias": 30.0}, 0.3),
    ],
)
def test_what_spring_and_motor_contradict_gravely_is_a_fault_as_soon_as_it_is_certain(
    monkeypatch, wave, torque, wrong, most
):
    """It was a warning after half a second, and of a reversed sine nothing."""
    guarded, now, device = bench(RIG)
    play(guarded, now, wave, 0.0, 1.0)
    assert play(guarded, now, wave, torque, 2.0)[0] == ""
    falsify(device, monkeypatch, **wrong)
    _, time = play(guarded, now, wave, torque, 6.0, until_fault=True)
    assert guarded.fault.cause == "ft" and time < most
    assert ": ft " in str(guarded.fault) and ", motor torque less momentum " in str(guarded.fault)
    assert guarded.cycle(10.0, 0.0) is not None and guarded.guard.torque == 0.0


LAZY = Gains(0.2575, 0.003029, 1.195, 6.99, 42.9)
KEEN = {
    RATE: Gains(1.09882, 0.0306961, 14.1714, 0.00615187, 4.79121),
    1000.0: Gains(9.00796, 0.0534406, 48.0585, 0.184229, 9.29901),
}
"""Of an earlier synthesis, and of the present one."""


def controlled(wave, seconds, falsified, rest=0.7, rate=RATE, gains=LAZY, torques=None):
    """Yield time, true ft, fault and contradiction by the limits; falsified: ft as it is read from 2 s on.

    rest: s before torque begins. torques: list that fills with what acts, N m.
    """
    values = {p.name: p.default for p in _control.TABLE} | {"rate": rate}
    limits = _control.ControllerLimits(_control.with_limits(values))
    controller = TorqueController(load_rig(RIG), rate, gains)
    plant, torque = Plant(load_rig(RIG), rate), 0.0
    for k in range(round(seconds * rate)):
        sample, time = plant.step(torque), k / rate
        read = replace(reading(sample), ft=falsified(sample.ft) if time > 2.0 else sample.ft)
        fault = limits.falsified(round(k * SECOND / rate), read, torque)
        if torques is not None:
            torques.append(torque)
        if time < rest:
            controller.start(read)
            continue
        torque = controller.step(read, 10.0 * WAVES[wave](time - rest, None))
        yield time, sample.ft, fault, limits.contradiction


@pytest.mark.parametrize(("gain", "wave"), [(0.5, "hold"), (0.5, "sine"), (1.0, "step")])
def test_a_controller_does_not_follow_an_ft_that_reads_half_to_twice_the_torque(gain, wave):
    """It did, without a fault, whatever the driver was."""
    made = []
    for _, ft, fault, _ in controlled(wave, 3.0, lambda ft: gain * ft):
        made.append(abs(ft))
        if fault:
            break
    assert bool(fault) == (gain == 0.5) and max(made) < 16.0


@pytest.mark.parametrize(("rest", "wave"), [(0.02, "hold"), (0.1, "sine")])
def test_an_ft_that_fades_is_a_fault_however_short_the_rest_before_torque_was(rest, wave):
    """It had no zero before a rest of 0.6 s: 68 N·m of 10, without a fault."""
    fading, made, fault = (1.0 - k / (2.0 * RATE) for k in range(10_000)), [], ""
    for _, ft, fault, _ in controlled(wave, 5.0, lambda ft: max(next(fading), 0.0) * ft, rest):
        made.append(abs(ft))
        if fault:
            break
    assert fault.startswith("ft: ") and max(made) < 17.0


@pytest.mark.parametrize(
    ("wave", "lie", "most"),
    [("rest", -1.0, 1.0), ("rest", -0.5, 1.5), ("sine", 0.0, 7.5), ("sine", -0.5, 6.0), ("sine", -1.0, 5.0)],
)
def test_an_ft_whose_sign_or_gain_is_lost_at_zero_torque_is_a_fault_in_the_first_newton_metres(
    wave, lie, most
):
    """There is no step to see, and behind a low-pass of 30 ms the motor made 27 to 40 N·m, on a bus 68."""
    made, fault = [], ""
    for _, ft, fault, _ in controlled(wave, 5.0, lambda ft: lie * ft, 1.0):
        made.append(abs(ft))
        if fault:
            break
    assert fault.startswith("ft: ") and max(made[round(RATE) :]) < most


@pytest.mark.parametrize("lie", [-1.0, -0.5])
@pytest.mark.parametrize(("rate", "most"), [(RATE, 4.0), (1000.0, 20.0)])
def test_of_an_ft_that_turns_its_sign_at_rest_the_motor_makes_little_at_any_rate(rate, most, lie):
    """At 1 kHz the motor made 56 N m of a spring that had 3.5, before two readings told."""
    torques, fault = [], ""
    for *_, fault, _ in controlled("rest", 3.0, lambda ft: lie * ft, 1.0, rate, KEEN[rate], torques):
        if fault:
            break
    assert fault.startswith("ft: ") and max(map(abs, torques[round(2.0 * rate) :])) < most


@pytest.mark.parametrize(
    ("effect", "given", "wave", "torque"),
    [
        ("encoder_delay", {"delay": 0.008}, "fast", 68.0), ("backlash", {"gap": 0.01}, "sine", 25.0),
        ("backlash", {"gap": 0.01}, "fast", 25.0), ("spring_hysteresis", {}, "step", 30.0),
        ("structural_resonance", {}, "noise", 68.0),
    ],
)  # fmt: skip
def test_a_late_encoder_and_play_that_nobody_states_are_no_lost_sign(effect, given, wave, torque):
    """Two readings without the changes of both called 4 of 670 sound runs so."""
    guarded, now, _ = bench(RIG, load_rig(RIG).with_effect(effect, **given))
    play(guarded, now, "rest", 0.0, 1.0)
    play(guarded, now, wave, torque, 4.0, until_fault=True)
    assert guarded.fault is None


def test_an_ft_that_fades_after_a_tare_is_a_fault_although_torque_follows_it_at_once(monkeypatch):
    """A tare forgot the zero until a rest of 0.6 s."""
    guarded, now, device = bench(RIG)
    play(guarded, now, "rest", 0.0, 1.0)
    guarded.zero_ft()
    assert play(guarded, now, "hold", 20.0, 1.0)[0] == ""
    falsify(device, monkeypatch, gain=0.4)
    assert play(guarded, now, "hold", 20.0, 1.0, until_fault=True)[1] < 0.1 and guarded.fault.cause == "ft"


@pytest.mark.parametrize("rest", [0, 160])
def test_a_zero_of_the_first_reading_yields_to_that_of_the_first_rest(rest):
    """The first one may be of a load that bends a spring which is another one than stated."""
    made, fault = Witnesses(Spring(100.0, 5, 1.0), ACTUATOR, 0.01), None
    for k in range(400 + rest):
        torque, gain = 0.0 if 40 <= k < 40 + rest else 10.0, 1.0 if k < 350 + rest else -1.0
        wrench = (0.0, 0.0, 0.0, 0.0, 0.0, gain * torque + 2.0)
        state = State(
            1 + k * SECOND // 100, 1e-6 * k, 0.0, torque + 1e-9 * (k % 2), wrench=wrench,
            deflection=0.9 * torque / 100.0,
        )  # fmt: skip
        fault = fault or made.take(state, torque)
        assert made.words == "" and (fault is None or k > 350 + rest)
    assert f"(ft is {2 if rest else 3} at rest)" in str(fault)


def test_a_controller_that_follows_an_ft_with_another_zero_says_so():
    """Its feedback makes half as much torque again of it; beside a sound driver it was "running"."""
    for time, _, fault, words in controlled("hold", 6.0, lambda ft: ft - 5.8):
        assert not fault and not (words and time < 2.0)
        assert time < 5.5 or "K times deflection" in words


@pytest.mark.parametrize("delay", [0.0, 0.04])
def test_a_delay_of_ft_that_the_rig_states_is_no_contradiction(monkeypatch, tmp_path, delay):
    """Beyond 10 ms one that nobody states is."""
    rig = load_rig(RIG)
    late = replace(rig, sensors={**rig.sensors, "ft": replace(rig.sensors["ft"], delay=delay)})
    save_rig(late, tmp_path / "model.yaml")
    guarded, now, device = bench(str(tmp_path / "model.yaml"), rig)
    read, waiting = device.read, deque([(0.0,) * 6] * 11, maxlen=12)

    def delayed():
        state = read()
        waiting.append(state.wrench)
        return replace(state, wrench=waiting[0])

    monkeypatch.setattr(device, "read", delayed)
    play(guarded, now, "rest", 0.0, 1.0)
    play(guarded, now, "sine", 30.0, 1.0, until_fault=True)
    assert (guarded.fault is None) == (delay > 0.0)


@pytest.mark.parametrize(
    ("wave", "torque", "wrong", "most"), [("hold", 27.0, 8.0, 0.9), ("sine", 20.0, 4.0, 3.0)]
)
def test_a_zero_that_changes_by_less_is_told_with_the_numbers(monkeypatch, wave, torque, wrong, most):
    """The driver went on without a word."""
    guarded, now, device = bench(RIG)
    play(guarded, now, wave, 0.0, 1.0)
    assert play(guarded, now, wave, torque, 2.0)[0] == ""
    falsify(device, monkeypatch, bias=wrong)
    told, time = play(guarded, now, wave, torque, 6.0)
    assert time < most and guarded.fault is None
    assert told.startswith("ft ") and ", motor torque less momentum " in told and "deflection " in told


@pytest.mark.parametrize(
    ("name", "sigmas", "wave"),
    [
        (RIG, -2.0, "hold"), (RIG, 2.0, "fast"), (RIG, -2.0, "pulses"), (RIG, 2.0, "noise"),
        (FREE, -2.0, "step"), (FREE, 2.0, "sine"), (FREE, -2.0, "noise"),
    ],
)  # fmt: skip
def test_a_sound_machine_with_values_at_the_ends_of_their_spread_is_told_nothing(name, sigmas, wave):
    """A rule that stops it would be worse than none."""
    rig = load_rig(name)
    plant = rig.with_values(
        {n: max(rig[n] * (1 + sigmas * rig.spread(n)), 0.05 * rig[n]) for n in rig.free()}
    )
    guarded, now, _ = bench(name, plant.with_effect("coulomb_friction", torque=4.0))
    play(guarded, now, wave, 0.0, 0.7)
    assert play(guarded, now, wave, 40.0 if name == RIG else 8.0, 2.5)[0] == "" and guarded.fault is None


def test_a_spring_that_is_not_as_stated_is_not_laid_on_ft():
    """Beyond what its stated spread allows, but the motor torque sides with ft."""
    plant = load_rig(RIG).with_effect("nonlinear_spring")
    guarded, now, _ = bench(RIG, plant)
    play(guarded, now, "hold", 0.0, 1.0)
    assert play(guarded, now, "sine", 60.0, 2.0)[0] == ""


def test_a_rest_does_not_make_a_falsified_zero_the_true_one(monkeypatch):
    """It was told under torque, and after a pause of two seconds no more."""
    guarded, now, device = bench(RIG)
    for wave, torque in (("rest", 0.0), ("hold", 10.0)):
        assert play(guarded, now, wave, torque, 1.0)[0] == ""
    falsify(device, monkeypatch, bias=8.0)
    assert play(guarded, now, "rest", 0.0, 3.0)[0] == ""
    _, after = play(guarded, now, "hold", 10.0, 3.0)
    assert guarded.fault.cause == "ft" and after < 0.1


@pytest.mark.parametrize("wrong", [{"bias": 10.0}, {"gain": -1.0}])
@pytest.mark.parametrize("rate", [50.0, 20.0])
def test_readings_far_apart_are_witnesses_too(monkeypatch, wrong, rate):
    """With no two cycles within 14 ms, as on a busy machine, a bias under torque was unnoticed."""
    guarded, now, device = bench(RIG)
    play(guarded, now, "rest", 0.0, 1.0)
    assert play(guarded, now, "hold", 10.0, 2.0, rate=rate)[0] == "" and guarded.fault is None
    falsify(device, monkeypatch, **wrong)
    assert play(guarded, now, "hold", 10.0, 1.0, until_fault=True, rate=rate)[1] < 4.5 / rate
    assert guarded.fault.cause == "ft"


def test_a_slow_rate_does_not_let_the_low_pass_run_away():
    """Below 17 Hz a sound machine had 1e15 N m, and a fault."""
    guarded, now, _ = bench(RIG, rate=12.0)
    for _ in range(600):
        now[0] += round(SECOND / 12.0)
        guarded.cycle(8.0, 0.0)
        assert guarded.contradiction == "" and (guarded.fault is None or guarded.fault.cause != "ft")


ACTUATOR = Actuator(
    damping=0.0, inertia=0.5, drag=2.0, by_angle=False, bent=0.2, driven=0.3, risen=0.3, dragged=0.5,
    play=0.25, friction=1.0, creep=2e-3, late=0.01,
)  # fmt: skip


def hold(ft, *, motor=10.0, bend=math.nan, seconds=6.0, sign=1.0, speed=0.0, **more):
    """Read a rest, where a deflection is measured, and constant torques at 100 Hz.

    Return the witnesses, when they told something, s, and their fault.
    """
    made, told, fault, begin = Witnesses(Spring(100.0, 5, sign), ACTUATOR, 0.01), math.nan, None, 0
    if not math.isnan(bend):
        begin = 80
    for k in range(begin + round(seconds * 100)):
        on = float(k >= begin)
        state = State(
            1 + k * SECOND // 100, 1e-6 * k, speed, on * motor + 1e-9 * (k % 2),
            wrench=(0.0, 0.0, 0.0, 0.0, 0.0, on * sign * ft), deflection=on * bend / 100.0, **more,
        )  # fmt: skip
        fault = fault or made.take(state, 10.0 * on)
        if math.isnan(told) and (made.words or fault):
            told = (k - begin) / 100.0
    return made, told, fault


@pytest.mark.parametrize(
    ("limit", "given"),
    [
        (10.0 + 0.25 + 3.0 + 1.0, {}), (10.0 - 4.25, {}), (-10.0 - 4.25, {"motor": -10.0}),
        (10.0 + 4.25, {"sign": -1.0}), (1.0 + 0.25 + 0.3 + 1.0, {"motor": 1.0}),
        (10.0 - 0.02 + 0.25 + 0.3 * 9.98 + 0.5 * 0.02 + 1.0, {"speed": 0.01}),
        (10.0 + 0.02 + 0.25 + 0.3 * 10.02 + 0.5 * 0.02 + 1.0, {"speed": -0.01}),
    ],
)  # fmt: skip
def test_ft_may_differ_from_the_motor_by_play_gain_motion_and_friction(limit, given):
    """A window of 0.5 s, and as long a contradiction."""
    far = math.copysign(0.01, limit - given.get("motor", 10.0))
    assert math.isnan(hold(limit - far, seconds=2.0, **given)[1])
    made, told, fault = hold(limit + far, seconds=2.0, **given)
    assert told == pytest.approx(1.0, abs=0.03) and fault is None
    motor = given.get("motor", 10.0) - 2.0 * given.get("speed", 0.0)
    said = f"ft {limit + far:.3g}, motor torque less momentum {motor:.3g} N·m contradict"
    assert made.words == f"{said} each other, expected them alike"


@pytest.mark.parametrize(
    ("limit", "given"),
    [(10.0 + 0.25 + 0.2 * 10.0, {"bend": 10.0}), (8.0 - 0.25 - 0.2 * 8.0, {"bend": 8.0, "motor": 8.1})],
)
def test_ft_may_differ_from_the_spring_by_play_and_stiffness(limit, given):
    far = math.copysign(0.05, limit - given["bend"])
    assert math.isnan(hold(limit - far, **given)[1])
    made, told, fault = hold(limit + far, **given)
    assert told > 1.0 and fault is None
    assert f"K times deflection {given['bend']:.3g} N·m contradict" in made.words
    assert math.isnan(hold(limit + far, **{**given, "motor": limit + far})[1]), "the spring is another one"
    assert math.isnan(hold(limit + far, **given, inferred=True)[1]), "ft is itself of the deflection"


@pytest.mark.parametrize(
    ("limit", "torque"), [(30.0, 20.0), (20.0 / 1.5, 20.0), (-0.625, 0.0), (0.625, 0.0), (-30.0, -20.0)]
)
def test_what_spring_and_motor_together_contradict_gravely_is_a_fault(limit, torque):
    """By 2.5 times the doubt of the smaller torque, 20 %, or of the play, 0.25 N·m."""
    given, far = {"bend": torque, "motor": torque, "seconds": 0.4}, math.copysign(0.05, limit - torque)
    assert hold(limit - far, **given)[2] is None
    _, told, fault = hold(limit + far, **given)
    assert (fault.cause, fault.unit) == ("ft", "N m") and fault.value > fault.limit and told <= 0.4
    given["motor"] += 0.6 * (limit - torque)
    assert hold(limit + far, **given)[2] is None, "the motor is between both"
