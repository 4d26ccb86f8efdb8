"""Every effect, optional parameters too, against a second implementation and a general solver."""

import math
from dataclasses import replace

import numpy as np
import pytest
import slow_equations
from effect_bench import ON_THE_BENCH, RIG, SIGNALS, command, drive, record_of, rms, simulate
from independent.bench import Bench, record_command
from slow_equations import B_M, B_S, DURATION, K_S, J, motion

from rsea_ros.effects._friction import _implicit_mean, mean_tanh
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.model.drive import drive_from
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

TOLERANCE = {"ft": 6e-3, "position": 1.5e-6, "velocity": 8e-5}
"""A fifth to two fifths of the sensors' noise."""


def test_every_effect_has_an_independent_equation_with_the_values_of_the_rig():
    assert {*slow_equations.LAWS, *slow_equations.LATE} == {e.name for e in ON_THE_BENCH}
    ours = (RIG["rotor.reflected_inertia"], RIG["chassis.inertia"], RIG["rotor.reflected_damping"],
            RIG["spring.stiffness"], RIG["spring.damping"], RIG["gear.ratio"])  # fmt: skip
    theirs = (slow_equations.J_M, slow_equations.J_SC, slow_equations.B_M,
              slow_equations.K_S, slow_equations.B_S, slow_equations.RATIO)  # fmt: skip
    assert ours == theirs


def both(name, parameters, duration=DURATION, rig=RIG):
    """Return what the simulation and the second implementation say of an effect."""
    commanded = command(280.0, duration)
    simulated = simulate(drive_from(record_of(commanded)), name, parameters, rig)
    return simulated, slow_equations.solve(name, parameters, commanded.y, commanded.t[1])


@pytest.mark.parametrize("effect", ON_THE_BENCH, ids=lambda e: e.name)
def test_the_simulation_obeys_the_equation_of_every_effect(effect):
    simulated, true = both(effect.name, effect.typical)
    nominal = simulate(drive_from(record_of(command(280.0, DURATION))))
    changed = [n for n in SIGNALS if not np.array_equal(simulated[n], nominal[n])]
    assert changed
    for name in SIGNALS:
        error = rms(simulated[name] - true[name])
        assert error < TOLERANCE[name], (name, error)
        if name in changed:
            assert error < 0.005 * rms(true[name] - nominal[name]), (name, error)


@pytest.mark.parametrize("effect", [e for e in ON_THE_BENCH if e.response], ids=lambda e: e.name)
def test_a_linear_effect_has_the_response_of_its_simulation(effect):
    """At 9 Hz, once the start has died away: ft shows what the motor does, too."""
    t = np.arange(280 * 6) / 280.0
    driven, late = drive_from(record_of(Channel(t, 10.0 * np.sin(18.0 * math.pi * t)))), slice(840, None)
    with_it, without = (
        np.exp(-18j * math.pi * t[late]) @ simulate(driven, *chosen)["ft"][late]
        for chosen in ((effect.name, effect.typical), ())
    )
    response = effect.response(effect.vector(effect.typical), 18j * math.pi)
    assert with_it / without == pytest.approx(response, rel=5e-3)


MASS, DAMPING, HEAVY = 0.5, 0.4, 6.0


def settled_part(t, p):
    """Return the part of a drift that is reached at t."""
    return math.expm1(-t / p["time_constant"]) / math.expm1(-DURATION / p["time_constant"])


def settling_sensor(t, x, u, p):
    w, a, torque = motion(x, u)
    return [w, a], torque + p["drift"] * settled_part(t, p)


def warming_motor(t, x, u, p):
    w, a, torque = motion(x, (1 + p["relative_change"] * settled_part(t, p)) * u)
    return [w, a], torque


def sensor_under_the_base(t, x, u, p):
    q, w, y, v = x
    torque = K_S * (q - y) + B_S * (w - v)
    held = p["stiffness"] * y + 2 * p["damping_ratio"] * math.sqrt(p["stiffness"] * p["inertia"]) * v
    pull = (torque - held) / p["inertia"]
    return [w, (u - B_M * w - torque) / J, v, pull], torque - p["above_sensor"] * p["inertia"] * pull


def dead_band(t, x, u, p):
    ramp = min(max((abs(u) - p["width"]) / (0.001 * p["width"]) + 0.5, 0.0), 1.0)
    begun = max(abs(u) - p["width"], 0.0) + p["jump"] * p["width"] * ramp
    w, a, torque = motion(x, math.copysign(begun, u))
    return [w, a], torque


def payload(t, x, u, p):
    q, w, y, v = x
    torque = K_S * (q - y) + B_S * (w - v)
    fall = (torque - DAMPING * v - (HEAVY + p["torque"]) * math.sin(y)) / MASS
    return [w, (u - B_M * w - torque) / J, v, fall], torque


VARIANTS = {
    "ft_drift": (2, settling_sensor, {"drift": 2.0, "time_constant": 0.4}),
    "torque_constant_drift": (2, warming_motor, {"relative_change": -0.2, "time_constant": 0.5}),
    "base_compliance": (4, sensor_under_the_base, {
        "stiffness": 3e4, "inertia": 0.5, "damping_ratio": 0.02, "above_sensor": 0.7}),
    "dead_zone": (2, dead_band, {"width": 4.0, "jump": 1.0}),
    "directional_load_friction": (*slow_equations.LAWS["directional_load_friction"], {
        "motor_coefficient": 0.1, "load_coefficient": 0.02, "quadratic": 0.01, "creep_velocity": 2e-3}),
    "gear_loss": (3, slow_equations.gear_loss, {"mean": 0.2, "difference": -0.06, "angle": 4e-3}),
    "gravity_error": (4, payload, {"torque": -4.0}),
}  # fmt: skip


@pytest.mark.parametrize("name", VARIANTS)
def test_simulation_obeys_the_whole_equation(name, monkeypatch):
    *law, p = VARIANTS[name]
    monkeypatch.setitem(slow_equations.LAWS, name, law)
    simulated, true = both(name, p, rig=pendulum_rig() if name == "gravity_error" else RIG)
    for signal in SIGNALS:
        assert rms(simulated[signal] - true[signal]) < TOLERANCE[signal], signal


def test_a_seat_behind_the_play_forgets_what_a_chassis_remembers():
    """A damped spring at resonance: the gear crosses the gap in 0.5 ms, and a chassis returns in 2 ms."""
    j, b, k, d, gap = 0.21, 1.9, 310.0, 0.55, 3e-3
    rig = RIG.with_values({
        "rotor.reflected_inertia": j - RIG["chassis.inertia"], "rotor.reflected_damping": b,
        "spring.stiffness": k, "spring.damping": d,
    })  # fmt: skip
    t = np.arange(700) / 500.0
    commanded = Channel(t, 10.0 * np.sin(2.0 * np.pi * 5.6 * t))

    def rate(q, w, u):
        side = math.copysign(1.0, q)
        deep = side * q - gap / 2
        push = max(k * deep + d * side * w, 0.0) if deep > 0.0 else 0.0
        return (u - b * w - side * push) / j

    q, w, h, true = 0.0, 0.0, 2e-3 / 50, []
    for u in np.repeat(commanded.y, 50):  # the midpoint rule
        q_half, w_half = q + 0.5 * h * w, w + 0.5 * h * rate(q, w, u)
        q, w = q + h * w_half, w + h * rate(q_half, w_half, u)
        true.append(q)
    true = np.array(true[49::50])
    seat, chassis = (
        simulate(drive_from(record_of(commanded)), "backlash", {"gap": gap, "on_gear": on}, rig)["position"]
        for on in (1.0, 0.0)
    )
    assert rms(seat - true) < 2e-4 * rms(true)
    assert rms(chassis - true) > 4e-3 * rms(true)


def pendulum_rig():
    """Return the bench with its spring's end free, a pendulum on it."""
    values = {"spring_end.inertia": MASS, "spring_end.damping": DAMPING, "spring_end.gravity": HEAVY}
    return replace(RIG.with_values(values), clamped=frozenset({"housing_end"}))


def test_an_unknown_payload_vanishes_and_is_refused_where_nothing_is_free():
    driven = drive(duration=1.0)
    for signal, values in simulate(driven, rig=pendulum_rig()).items():
        with_none = simulate(driven, "gravity_error", {"torque": 0.0}, pendulum_rig())[signal]
        np.testing.assert_array_equal(with_none, values)
    with pytest.raises(ParameterError, match="both ends clamped, expected a free one"):
        simulate(driven, "gravity_error", {"torque": 1.0})


def test_a_drift_far_longer_than_the_record_is_a_straight_line():
    driven = drive(duration=2.0)
    straight, slow = (
        simulate(driven, "ft_drift", {"drift": 3.0, "time_constant": tau})["ft"]
        for tau in (np.inf, 299.0 * 2.0)
    )
    assert rms(straight - slow) < 1e-3


@pytest.mark.parametrize("gamma", [-1.711, -0.4, 0.5])  # hardening, faster unloading, straight
def test_the_simulation_obeys_the_law(gamma, monkeypatch):
    p = {"torque": 2.0, "angle": 4e-3, "gamma": gamma}
    beta = (1.0 if gamma >= -0.5 else 1.0 - (gamma + 0.5) ** 2) - gamma

    def law(t, x, u, p):
        w, a, torque = slow_equations.motion(x[:2], u, spring=p["torque"] * x[2])
        rate = w - (beta * abs(w) * x[2] + gamma * w * abs(x[2]))
        return [w, a, rate / p["angle"]], torque

    monkeypatch.setitem(slow_equations.LAWS, "spring_hysteresis", (3, law))
    simulated, true = both("spring_hysteresis", p, duration=1.0)
    for name in SIGNALS:
        assert rms(simulated[name] - true[name]) < TOLERANCE[name], name


def test_the_law_without_a_shape_parameter_is_dahls():
    driven = drive_from(record_of(command(280.0, 2.0)))
    short, full = (
        simulate(driven, "spring_hysteresis", {"torque": 1.0, "angle": 2e-3, **more})
        for more in ({}, {"gamma": 0.0})
    )
    for name in SIGNALS:
        np.testing.assert_array_equal(short[name], full[name])
    straight = simulate(driven, "spring_hysteresis", {"torque": 1.0, "angle": 2e-3, "gamma": 0.5})
    assert rms(straight["ft"] - short["ft"]) > 0.03
    assert RIG.with_effect("spring_hysteresis").effects[0].parameters["gamma"] == 0.0


def test_a_chassis_takes_a_part_of_the_rotors_inertia_unless_its_own_is_stated():
    rig = load_rig("sea_two_encoders")
    change = effect_named("gear_compliance").structure
    soft = change(rig, {"stiffness": 1e4})
    assert np.linalg.eigvalsh(mechanics(soft).mass).min() > 0.0
    both = soft["rotor.reflected_inertia"] + soft["chassis.inertia"]
    assert both == pytest.approx(rig["rotor.reflected_inertia"])
    stated = change(RIG, {"stiffness": 1e4, "damping_ratio": 1e-15})
    assert all(stated[n] == RIG[n] for n in ("chassis.inertia", "rotor.reflected_inertia"))
    assert stated["gear.damping"] == 0.0, "1e-14 N m s/rad is no value of a rig: a diagnosis ended there"


def test_a_gear_at_rest_takes_few_steps(monkeypatch):
    """On slow machines friction is 10^6 creep velocities strong; a step took 20 rounds."""
    rounds = []

    def count(*arguments):
        rounds.append(arguments)
        return mean_tanh.py_func(*arguments)

    monkeypatch.setitem(_implicit_mean.py_func.__globals__, "mean_tanh", count)
    for share in (-0.9, -0.3, 0.0, 0.1, 0.7):
        _implicit_mean.py_func(math.atanh(0.99 * share), 1e6 * share, 1e6)
    assert len(rounds) <= 5 * 9


T = np.arange(280) / 280.0
NOISE, CHIRP = np.random.default_rng(3).standard_normal(280), np.sin(2.0 * np.pi * (0.5 + 9.75 * T) * T)


@pytest.mark.parametrize("gap", [1e-3, 4e-3])
@pytest.mark.parametrize("wave", [NOISE, CHIRP], ids=["noise", "chirp"])
def test_play_beside_a_free_housing_moves_as_on_the_second_bench(wave, gap):
    """Asked: 1 % RMS. With impacts that owe the next step nothing it was 5 % and more at 4 mrad."""
    quiet = dict.fromkeys(("ft_noise", "position_quantum", "velocity_noise", "velocity_quantum"), 0.0)
    flanks = {"contact_k": 1e6, "contact_b": 2.0 * math.sqrt(1e6 * slow_equations.J_SC)}  # do not bounce
    bench = Bench().with_values(housing_free=1.0, gap=gap, **flanks, **quiet)
    expected = record_command(bench, 30.0 * wave, np.random.default_rng(0))
    worn = load_rig("paper_moving_output").with_effect("backlash", gap=gap)
    record = synthesize(worn, Channel(T, 30.0 * wave), noise=False)
    for channel in ("position", "ft"):
        of = expected[channel].y
        assert np.std(record[channel].y - of) < 0.01 * np.std(of), channel
