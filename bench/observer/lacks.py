"""The observer on plants of another hand, which its model lacks something of: Runge-Kutta at 50 kHz.

The equations of test/independent, clamped or with a free housing, with the values of the paper's bench and of
an actuator 95 times lighter. No code of the project's simulation or effects.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from independent.equations import DG, DH, G, H, sensor_torques
from independent.plant import Plant
from independent.solvers import run_fixed

from bench.results import Row
from rsea_ros.model.observer import Observer, observe
from rsea_ros.model.observer.assemble import NOTHING
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, FloatArray, Record

SETTLE = 0.5
TEETH, LOSS, CREEP = 4e5, 60.0, 2e-3
"""Of K_s = 1530 N m/rad, scaled with it: stiffness and damping of the teeth in contact; rad/s at which dry
friction is three quarters of itself."""


@dataclass(frozen=True)
class Actuator:
    """A rig clamped and one with a free housing, samples a second, size of chirp and noise commanded, N m,
    the friction (N m) and the play (rad) that a model may lack."""

    clamped: Rig
    free: Rig
    rate: float
    size: tuple[float, float]
    friction: float
    play: float


def actuators() -> Mapping[str, Actuator]:
    """Return the paper's bench and a small actuator of a quite different kind."""
    paper, moving = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
    small = {
        "rotor.reflected_inertia": 0.01, "rotor.reflected_damping": 0.08, "gear.ratio": 50.0,
        "chassis.inertia": 2e-4, "spring.stiffness": 60.0, "spring.damping": 0.05,
    }  # fmt: skip
    sensors = {n: replace(s, noise=a, quantum=q) for (n, s), (a, q) in zip(
        sorted(paper.sensors.items()), ((4e-3, 0.0), (5e-3, 5e-3), (2e-5, 5e-5), (1e-3, 0.0)), strict=True)
    }  # fmt: skip
    light = {"housing_end.inertia": 0.004, "housing_end.stiffness": 0.3, "housing_end.damping": 0.002}
    rigs = (replace(r.with_values(v), sensors=sensors) for r, v in ((paper, small), (moving, small | light)))
    return {"bench": Actuator(paper, moving, 280.0, (12.0, 3.0), 2.0, 3e-3),
            "small": Actuator(*rigs, 1000.0, (0.6, 0.15), 0.1, 8e-3)}  # fmt: skip


@dataclass(frozen=True)
class Run:
    """A record and, at its measurements, the torque where the F/T sensor is and that of friction, N m."""

    record: Record
    torque: FloatArray
    friction: FloatArray


def played(rig: Rig, command: FloatArray, rate: float, seed: int, values: Mapping[str, float] = NOTHING,
           play: float = 0.0, friction: float = 0.0, noise: float = 1.0,
           zero: float = 0.0) -> Run:  # fmt: skip
    """Return a run of a plant. values: factors on the rig's; play: rad; friction: N m; noise: factor on that
    of the F/T sensor; zero: its zero, in sigmas of its noise."""
    r = rig.with_values({name: factor * rig[name] for name, factor in values.items()})
    teeth = TEETH / 1530.0 * r["spring.stiffness"]
    plant = Plant(
        j_m=r["rotor.reflected_inertia"], b_m=r["rotor.reflected_damping"], k_s=r["spring.stiffness"],
        b_s=r["spring.damping"], j_sc=r["chassis.inertia"], ratio=r["gear.ratio"], gap=play, contact_k=teeth,
        contact_b=teeth * LOSS / TEETH, coulomb=friction, v_0=CREEP,
    )  # fmt: skip
    if r.end_is_free("housing_end"):
        inertia, stiffness, damping = (r[f"housing_end.{n}"] for n in ("inertia", "stiffness", "damping"))
        plant = plant._replace(housing_free=1.0, j_h=inertia, k_h=stiffness, b_h=damping)
    t, rng = np.arange(len(command)) / rate, np.random.default_rng(seed)
    states, _ = run_fixed(command, np.zeros(len(t)), 1.0 / rate, plant, round(5e4 / rate))
    torque = sensor_torques(t + 1.0 / rate, states, plant)
    measured = {}
    for name, true in (("position", states[:, G] - states[:, H]), ("motor_torque", command), ("ft", torque)):
        sensor = rig.sensors[name]
        factor, off = (noise, zero) if name == "ft" else (1.0, 0.0)
        y = true + sensor.noise * (factor * rng.standard_normal(len(t)) + off)
        y = np.round(y / sensor.quantum) * sensor.quantum if sensor.quantum else y
        measured[name] = Channel(t + 1.0 / rate, y)
    rubbed = -friction * np.tanh((states[:, DG] - states[:, DH]) / CREEP)
    return Run(Record({"command": Channel(t, command), **measured}, source=rig.name), torque, rubbed)


def chirp(rate: float, seconds: float, size: tuple[float, float], seed: int) -> FloatArray:
    """Return a chirp from 0.2 to 60 Hz with white noise, N m."""
    t = np.arange(round(seconds * rate)) / rate
    phase = 2.0 * np.pi * 0.2 * seconds / np.log(300.0) * (300.0 ** (t / seconds) - 1.0)
    return size[0] * np.sin(phase) + size[1] * np.random.default_rng(seed).standard_normal(len(t))


def late(observer: Observer, record: Record) -> FloatArray:
    """Return the estimates from samples that come up to 60 ms late, each its own time, shape (n, 6)."""
    rng, events = np.random.default_rng(5), []
    for name in ("command", "position", "ft"):
        for k, (t, y) in enumerate(zip(record[name].t.tolist(), record[name].y.tolist(), strict=True)):
            delay = rng.uniform(-0.1, 0.0) if name == "command" else rng.uniform(0.0, 0.06)
            events.append((t + delay, name, k, t, y))
    rows = np.full((len(record["ft"].t), 6), np.nan)
    for _, name, k, t, y in sorted(events):
        if name == "command":
            observer.command(t, y)
        elif name == "position":
            observer.state(t, y, float(record["motor_torque"].y[k]))
        else:
            rows[k] = observer.ft(t, y) or np.nan
    return rows


def cases(a: Actuator) -> Mapping[str, tuple[Rig, Rig, Mapping[str, float | Mapping[str, float]]]]:
    """Return by name plant, model, and what the plant has that the model lacks."""
    rubs = a.clamped.with_effect("coulomb_friction", torque=a.friction)
    j, b = "rotor.reflected_inertia", "spring.damping"
    return {
        "nothing": (a.clamped, a.clamped, {}),
        "b_s half of it": (a.clamped, a.clamped, {"values": {b: 0.5}}),
        "b_s 1.5 times": (a.clamped, a.clamped, {"values": {b: 1.5}}),
        "J_m 10 % more": (a.clamped, a.clamped, {"values": {j: 1.1}}),
        "J_m 10 % less": (a.clamped, a.clamped, {"values": {j: 0.9}}),
        "K_s 5 % more": (a.clamped, a.clamped, {"values": {"spring.stiffness": 1.05}}),
        "friction": (a.clamped, a.clamped, {"friction": a.friction}),
        "friction, stated": (a.clamped, rubs, {"friction": a.friction}),
        "play": (a.clamped, a.clamped, {"play": a.play}),
        "play, stated": (a.clamped, a.clamped.with_effect("backlash", gap=a.play), {"play": a.play}),
        "F/T noise 5 times": (a.clamped, a.clamped, {"noise": 5.0}),
        "F/T zero off by 17 σ": (a.clamped, a.clamped, {"zero": 17.0}),
        "samples late": (a.clamped, a.clamped, {}),
        "free housing": (a.free, a.free, {}),
        "free housing, b_s half": (a.free, a.free, {"values": {b: 0.5}}),
        "free housing, friction": (a.free, a.free, {"friction": a.friction}),
    }


def measure(a: Actuator, name: str, seconds: float, seeds: Sequence[int]) -> tuple[float, float, float]:
    """Return RMS error of the torque at the F/T sensor, the sensor's own, N m, and the part within 2 σ."""
    plant, model, more = cases(a)[name]
    end, errors, own, inside = int(model.proximal == "spring_end"), [], [], []
    for seed in seeds:
        run = played(plant, chirp(a.rate, seconds, a.size, seed), a.rate, 100 + seed, **more)  # type: ignore[arg-type]
        observer = Observer(model)
        rows = late(observer, run.record) if name == "samples late" else observe(observer, run.record)[1]
        heard = np.isfinite(rows[:, 0]) & (np.arange(len(rows)) > SETTLE * a.rate)
        error = (rows[:, end] - run.torque)[heard]
        errors.append(error)
        own.append((run.record["ft"].y - run.torque)[heard])
        inside.append(np.abs(error) < 2.0 * rows[heard, 3 + end])
    rms = (float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for e in (errors, own))
    return *rms, float(np.mean(np.concatenate(inside)))


def lacks() -> Iterator[Row]:
    """Tell the error of T at the F/T sensor where the model lacks something, on plants of another hand."""
    both = actuators()
    for case in cases(both["bench"]):
        told = {}
        for label, a in both.items():
            error, own, inside = measure(a, case, 8.0, (1, 2, 3))
            told |= {label: f"{error:.4f}", f"{label}: of the sensor's": f"{error / own:.2f}",
                     f"{label}: within 2 σ": f"{100.0 * inside:.1f} %"}  # fmt: skip
        yield Row(case, "≤ 1.10; 93 to 97 %", told)
