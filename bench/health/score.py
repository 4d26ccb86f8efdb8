"""The health monitor on joints of test/independent at work, first healthy and then with a fault.

alarms  false alarms over hours of clean work
faults  each fault switched on after five minutes of work: named, delay, size
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from independent.bench import Bench, record_command

from bench.diagnosis.cases import RIG, RIG_VALUES
from bench.results import Row
from rsea_ros.health.health_finding import HealthFinding, WatchSettings
from rsea_ros.health.monitor import Monitor
from rsea_ros.model.observer import noise_of
from rsea_ros.model.observer.log import events_of
from rsea_ros.model.rig import EffectSetting, Quantity, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, FloatArray, Record
from rsea_ros.records.statistics import Z95

RATE, PIECE = 280.0, 60.0
DOUBT = dict(zip(RIG_VALUES, (0.003, 0.02, 0.002, 0.03), strict=True))
"""Relative one-sigma errors of a last model.yaml; a chirp of 60 s makes them smaller."""
FRICTION_DOUBT = 0.03
CLEAN, WORN = 300.0, 60.0
"""s of work before a fault, with learning (it waits for motion), and after it."""


class Fault(NamedTuple):
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
    rig = load_rig(RIG)
    quantities = dict(rig.quantities)
    for name, key in RIG_VALUES.items():
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
    return Monitor(rig, noise_of(rig), WatchSettings(**settings))


def alarms(
    *, hours: float = 0.5, seeds: tuple[int, ...] = (0, 1, 2), stated: float = 1e-3
) -> Iterator[Row]:
    """Watch clean work of another bench each seed: every finding is a false alarm.

    stated: false alarms an hour, from which the thresholds follow
    """
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        bench, rig = draw_bench(rng)
        raised = list(watch(monitor_of(rig, rate=stated), pieces(bench, 3600.0 * hours, rng)))
        told = "; ".join(f"{f.code} {f.name} {f.size:.3g} at {at:.0f} s" for at, f in raised)
        yield Row(f"seed {seed}, {hours:g} h: findings", f"<= {stated * hours:g}", f"{len(raised)}; {told}")


def faults(*, seeds: tuple[int, ...] = (0, 1, 2)) -> Iterator[Row | str]:
    """Switch a fault on after clean work; the last name within a minute counts, and the delay to it."""
    rows: dict[str, list[tuple[bool, float]]] = {name: [] for name in FAULTS}
    fits: list[float] = []
    for seed in seeds:
        for name, fault in FAULTS.items():
            rng = np.random.default_rng([seed, 2])
            bench, rig = draw_bench(rng)
            monitor = monitor_of(rig)
            early = list(watch(monitor, pieces(bench, CLEAN, rng)))
            raised = list(watch(monitor, pieces(faulty(bench, fault), WORN, rng, CLEAN), fits))
            names = [f.code for f in monitor.changes.findings.values()] if monitor.changes else []
            times = [at - CLEAN for at, f in raised if f.code == fault.code]
            right = set(names) == {fault.code}
            told = ", ".join(f"{f.code} {f.name} {f.size:.4g} after {at - CLEAN:.1f} s" for at, f in raised)
            yield f"seed {seed} {name}: {'right' if right else 'WRONG'}; {told or 'nothing'}"
            if early:
                yield f"  false before: {', '.join(f.code for _, f in early)}"
            rows[name].append((right, min(times, default=np.inf)))
    yield f"fits of causes: {len(fits)}, {np.median(fits):.1f} s of a core, the longest {max(fits):.1f} s"
    for name, each in rows.items():
        delays = [delay for _, delay in each]
        told = f"{sum(right for right, _ in each)} of {len(each)}, median {np.median(delays):.1f} s"
        yield Row(f"{name}: named, after", "all", f"{told}, at most {max(delays):.1f} s")
