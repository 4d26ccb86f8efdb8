"""Along a measured motion: what its noise makes of the torques, and where they say nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.initial_guess import ripples
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.identify import identify
from rsea_ros.identification.problem import case_from
from rsea_ros.model.inverse import as_seen, motion_from, noise_along, spring_mode, torques_along
from rsea_ros.model.rig import Rig, Sensor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

RATE, PARTS = 250.0, 10
INERTIA, DAMPING, GRAVITY, STEP = 0.08, 0.08, 1.8, 3.8e-4


def pendulum_rig() -> Rig:
    """Return the rig of `swung`, its damping and gravity not known well."""
    rig = load_rig("pendulum")
    values = {"rotor.reflected_inertia": 0.03, "rotor.reflected_damping": 0.1, "gear.ratio": 36.0,
              "spring_end.inertia": 0.056, "spring_end.gravity": 2.0}  # fmt: skip
    sensors = {**rig.sensors, "position": Sensor(noise=1e-4, quantum=STEP)}
    return replace(rig.with_values(values), sensors=sensors)


def swung(seconds: float, late: float = 0.0, friction: float = 0.0, seed: int = 0) -> Record:
    """Return a pendulum of plain Python on a held command, Runge and Kutta's, its encoder rounded."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    u = 1.2 * np.sin(2.0 * np.pi * 0.3 * t + 2.0 * np.sin(0.7 * t)) + 0.4 * rng.standard_normal(len(t))
    h, q, w, angles = 1.0 / (RATE * PARTS), 0.0, 0.0, []
    steps = round(late * RATE * PARTS)

    def rate(w, q, torque):
        rubbed = friction * np.tanh(w / 1e-3)
        return (torque - rubbed - DAMPING * w - GRAVITY * np.sin(q)) / INERTIA

    for k in range(len(t)):
        angles.append(q)
        for j in range(k * PARTS - steps, (k + 1) * PARTS - steps):
            torque = u[j // PARTS] if j >= 0 else 0.0
            a = rate(w, q, torque)
            b = rate(w + 0.5 * h * a, q + 0.5 * h * w, torque)
            c = rate(w + 0.5 * h * b, q + 0.5 * h * w + 0.25 * h * h * a, torque)
            d = rate(w + h * c, q + h * w + 0.5 * h * h * b, torque)
            q, w = q + h * w + h * h * (a + b + c) / 6.0, w + h * (a + 2.0 * b + 2.0 * c + d) / 6.0
    read = np.round((np.array(angles) + 1e-4 * rng.standard_normal(len(t))) / STEP) * STEP
    return Record({"command": Channel(t, u), "position": Channel(t, read)})


@pytest.mark.parametrize("torque", (0.0, 0.05))
def test_the_noise_along_a_motion_is_the_scatter_of_many_readings_of_it(torque):
    """Against 30 draws; of the torque too, where it was measured."""
    rig, t, rng = pendulum_rig(), np.arange(800) / RATE, np.random.default_rng(1)
    angle = 0.8 * np.sin(2.0 * np.pi * 0.7 * t)
    beside = {"motor_torque": np.cos(9.0 * t)} if torque else {}
    white, left = {"position": 1e-4, "motor_torque": torque}, []
    for _ in range(30):
        read = {n: Channel(t, y + white[n] * rng.standard_normal(len(t))) for n, y in
                {"position": angle, **beside}.items()}  # fmt: skip
        motion = motion_from(Record({"command": Channel(t, np.cos(9.0 * t)), **read}), rig)
        motion = motion.with_noise(rig, {n: white[n] for n in read})
        left.append((motion.judged["motor_torque"] - torques_along(rig, motion)["motor_torque"])[250:-250])
    scatter = float(np.sqrt(np.mean(np.var(left, axis=0, ddof=1))))
    assert motion.corner < 20.0
    assert noise_along(rig, motion)["motor_torque"] == pytest.approx(scatter, rel=0.1)


@pytest.mark.parametrize("rate", (12.0, 33.0, 1000.0))
def test_a_slow_log_has_a_corner_below_half_its_rate(rate):
    rig, t = pendulum_rig(), np.arange(400) / rate
    motion = motion_from(Record({n: Channel(t, np.sin(t)) for n in ("command", "position")}), rig)
    for noise in (1e-5, 1e-4, 1e-3):
        judged = motion.with_noise(rig, {"position": noise}).judged["motor_torque"]
        assert np.isfinite(judged).all()


@pytest.mark.parametrize(("late", "named"), ((0.0, ()), (0.006, ("command_delay",))))
def test_a_bare_drive_of_plain_python_is_at_its_noise_and_its_late_command_a_delay(late, named):
    """Flawless it was 1.9 times its noise, and the delay an overshoot, which undoing had made of it."""
    tried = {"command_delay", "current_loop_lag", "current_loop_overshoot", "encoder_delay"}
    settings = DiagnosisSettings(without=tuple(catalogue().keys() - tried))
    diagnosis = diagnose([swung(8.0, late)], pendulum_rig(), settings=settings)
    assert tuple(c.name for c in diagnosis.causes) == named
    assert diagnosis.verdict == ("explained" if named else "nothing_wrong")
    for cause in diagnosis.causes:
        assert cause.status == "confirmed"
        assert cause.parameters["delay"].value == pytest.approx(late, abs=3e-4)


def test_a_gear_that_sticks_says_nothing_of_its_friction_while_it_stands():
    """For half the record the torque stays below the friction: 0.30 N m was found for 0.33."""
    t, h, q, w = np.arange(3000) / 50.0, 5e-4, 0.0, 0.0
    wish = np.where(t < 30.0, 0.02 * np.sin(0.8 * t), 0.5 * np.sin(0.45 * t) + 0.2 * np.sin(1.3 * t))
    torques, angles = [], []
    for k in range(len(t)):
        torques.append(8.0 * (wish[k] - q) - 0.4 * w)
        angles.append(q)
        for _ in range(40):
            torque = 8.0 * (wish[k] - q) - 0.4 * w
            if w == 0.0 and abs(torque) <= 0.36:
                continue
            way = np.sign(w) if w != 0.0 else np.sign(torque)
            after = w + h * (torque - 0.33 * way - 0.27 * w) / 0.04
            w = 0.0 if w * after < 0.0 else after
            q += h * w
    rng = np.random.default_rng(2)
    torque = np.array(torques)
    read = {"command": torque, "motor_torque": torque + 0.01 * rng.standard_normal(len(t)),
            "position": np.round(np.array(angles) / STEP) * STEP}  # fmt: skip
    rig = pendulum_rig().with_values({"spring_end.inertia": 0.02, "spring_end.gravity": 0.1})
    record = Record({n: Channel(t, y) for n, y in read.items()})
    found = identify([record], rig.with_effect("coulomb_friction", torque=0.2, creep_velocity=2e-3))
    values = {p.name: p.value for p in found.parameters}
    assert values["coulomb_friction.torque"] == pytest.approx(0.33, abs=0.02)


def test_ripple_is_looked_for_along_the_angle_that_the_torque_of_a_held_spring_shows():
    """Without an encoder nothing explained it."""
    rig = load_rig("paper_high_impedance")
    t = np.arange(4200) / 280.0
    command = 60.0 * np.sin(2.0 * np.pi * (0.3 + 0.2 * t) * t)
    cogging = rig.with_effect("torque_ripple", amplitude=3.0, cycles_per_revolution=3.0, phase=0.5)
    run = simulate(cogging, command, rate=280.0)
    case = case_from(replace(run, channels={n: run[n] for n in ("command", "ft")}), rig)
    nominal = {"ft": simulate(rig, command, rate=280.0, noise=False)["ft"].y}
    first = ripples(case, rig, nominal)[0]
    travel = rig["gear.ratio"] * np.ptp(run["ft"].y) / rig["spring.stiffness"]
    assert abs(first["cycles_per_revolution"] - 3.0) * travel < 0.5 * 2.0 * np.pi


STIFF = """
name: joint
housing_end: {clamped: true}
spring_end: {inertia: {value: 0.02, unit: kg m^2}}
rotor: {reflected_inertia: {value: 0.02, unit: kg m^2}, reflected_damping: {value: 0.2, unit: N m s/rad}}
gear: {ratio: {value: 40, unit: "1"}, train: lumped}
spring: {stiffness: {value: %s, unit: N m/rad}, damping: {value: 2.0, unit: N m s/rad}}
"""


@pytest.mark.parametrize(
    ("stiffness", "beside", "is_rigid"), ((2000.0, (), True), (100.0, (), False), (2000.0, ("ft",), False))
)
def test_a_spring_that_no_record_can_show_is_rigid(tmp_path, stiffness, beside, is_rigid):
    """On 2000 N m/rad two inertias of 0.02 swing at 71 Hz, on 100 at 16; logged at 33. F/T shows it."""
    (tmp_path / "joint.yaml").write_text(STIFF % stiffness)
    rig, t = load_rig(str(tmp_path / "joint.yaml")), np.arange(100) / 33.0
    run = Record({n: Channel(t, np.sin(t)) for n in ("command", "position", *beside)})
    assert spring_mode(rig) == pytest.approx(np.sqrt(stiffness * 100.0) / (2.0 * np.pi), rel=1e-3)
    seen, numbers = as_seen(rig, [run])
    assert seen.rigid_spring == is_rigid
    assert numbers == ((spring_mode(rig), run["command"].rate) if is_rigid else ())
