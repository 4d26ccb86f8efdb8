"""Joints of test/independent at work, first healthy and then with a fault, and the monitor's findings."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from independent.bench import Bench, record_command

from rsea_ros.health.health_finding import HealthFinding, WatchSettings
from rsea_ros.health.monitor import Monitor
from rsea_ros.model.observer import noise_of
from rsea_ros.model.observer.log import events_of
from rsea_ros.model.rig import EffectSetting, Quantity, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, FloatArray, Record
from rsea_ros.records.statistics import Z95

RATE, PIECE = 280.0, 60.0
DOUBT: Mapping[str, float] = {
    "rotor.reflected_inertia": 0.003, "rotor.reflected_damping": 0.02, "spring.stiffness": 0.002,
    "spring.damping": 0.03,
}  # fmt: skip
"""Relative one-sigma errors of a last model.yaml; a chirp of 60 s makes them smaller."""
FRICTION_DOUBT = 0.03


@dataclass(frozen=True)
class Fault:
    """A change of the bench, and the right code for it. times: factors, not values."""

    code: str
    change: Mapping[str, float]
    times: bool = False


FAULTS: Mapping[str, Fault] = {
    "stiffness -15 %": Fault("RSEA_STIFFNESS", {"k_s": 0.85}, times=True),
    "friction x 1.5": Fault("RSEA_FRICTION", {"coulomb": 1.5, "b_m": 1.5}, times=True),
    "gap 4 mrad": Fault("RSEA_BACKLASH", {"gap": 4e-3}),
    "delay of 2 samples": Fault("RSEA_DELAY", {"delay": 2.0 / RATE}),
    "F/T gain +10 %": Fault("RSEA_FT_GAIN", {"ft_gain": 1.1}),
    "resonance (no code)": Fault("RSEA_UNEXPLAINED", {"resonance": 0.4}),
}


def draw_bench(rng: np.random.Generator) -> tuple[Bench, Rig]:
    """Return a bench of its own values with dry friction, and the rig that its last identification left."""
    plant = Bench().plant
    values = {
        "j_m": plant.j_m * rng.uniform(0.85, 1.15), "b_m": rng.uniform(5.0, 20.0),
        "k_s": plant.k_s * rng.uniform(0.8, 1.2), "b_s": plant.b_s * rng.uniform(0.7, 1.3),
        "coulomb": rng.uniform(1.0, 4.0),
    }  # fmt: skip
    names = dict(zip(DOUBT, ("j_m", "b_m", "k_s", "b_s"), strict=True))
    rig = load_rig("paper_high_impedance")
    quantities = dict(rig.quantities)
    for name, key in names.items():
        sigma = DOUBT[name] * values[key]
        value = values[key] + sigma * rng.standard_normal()
        quantities[name] = Quantity(value, 0.05, "drawn", (value - Z95 * sigma, value + Z95 * sigma))
    torque = values["coulomb"] * (1.0 + FRICTION_DOUBT * rng.standard_normal())
    known = replace(rig, quantities=quantities)
    return Bench().with_values(**values), known.with_effects(
        EffectSetting("coulomb_friction", {"torque": torque})
    )


def faulty(bench: Bench, fault: Fault) -> Bench:
    """Return the bench with a fault."""
    now = {**bench.plant._asdict(), **bench.outside._asdict()}
    return bench.with_values(**{k: v * now[k] if fault.times else v for k, v in fault.change.items()})


def work(seconds: float, rng: np.random.Generator) -> FloatArray:
    """Return commands of work, N m: bouts of periodic or reaching movements of any size, with rests."""
    t = np.arange(round(seconds * RATE)) / RATE
    u, at = np.zeros(len(t)), 0.0
    while at < seconds:
        length = rng.uniform(4.0, 25.0)
        on = (t >= at) & (t < at + length)
        since = t[on] - at
        fade = np.clip(np.minimum(since, length - since) / 0.5, 0.0, 1.0)
        u[on] = fade * (_cyclic(since, rng) if rng.random() < 0.7 else _reach_loads(since, rng))
        at += length + rng.uniform(0.0, 6.0)
    return u


def _cyclic(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a gait: four harmonics of 0.4 to 1.6 Hz, on a load, N m."""
    size, pace = rng.uniform(4.0, 14.0), rng.uniform(0.4, 1.6)
    waves = [np.sin(2 * np.pi * pace * h * t + rng.uniform(0, 2 * np.pi)) / h**1.2 for h in (1, 2, 3, 4)]
    total: FloatArray = size * np.sum(waves, axis=0) + rng.uniform(-6.0, 6.0)
    return total


def _reach_loads(t: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return holds at levels that are reached within 0.15 to 0.6 s, N m."""
    u, at, level = np.zeros(len(t)), 0.0, 0.0
    while at < t[-1]:
        new, rise = rng.uniform(-15.0, 15.0), rng.uniform(0.15, 0.6)
        share = np.clip((t - at) / rise, 0.0, 1.0)
        u = np.where(t >= at, level + (new - level) * share**3 * (10.0 - 15.0 * share + 6.0 * share**2), u)
        at, level = at + rise + rng.uniform(0.3, 2.0), new
    return u


def pieces(bench: Bench, seconds: float, rng: np.random.Generator, start: float = 0.0) -> Iterator[Record]:
    """Yield records of work one after the other, each of a minute, stamps from `start` on."""
    done = 0.0
    while done < seconds:
        length = min(PIECE, seconds - done)
        record = record_command(bench, work(length, rng), rng)
        begin = start + done
        yield Record({n: Channel(c.t + begin, c.y) for n, c in record.channels.items()}, "work")
        done += length


def watch(
    monitor: Monitor, records: Iterator[Record], fits: list[float] | None = None
) -> Iterator[tuple[float, HealthFinding]]:
    """Feed a monitor with the measurements, as a node does; yield the time of each finding that is new, s.

    fits: gets the CPU time of each fit of causes, s.
    """
    for record in records:
        t, kind, values = events_of(record)
        step = max(1, round(len(t) * 0.25 / max(float(t[-1] - t[0]), 0.25)))
        for k in range(0, len(t), step):
            monitor.take(t[k : k + step], kind[k : k + step], values[k : k + step])
            if monitor.job is None:
                continue
            begun = time.process_time()
            answer = monitor.job()
            if fits is not None:
                fits.append(time.process_time() - begun)
            if (finding := monitor.conclude(answer)) is not None:
                yield monitor.now, finding


def monitor_of(rig: Rig, **settings: float) -> Monitor:
    """Return a monitor of a rig."""
    return Monitor(rig, noise_of(rig), WatchSettings(**settings))  # type: ignore[arg-type]
