"""The bags of the matrix: a bench simulated with one of each factor, its channels then damaged as asked."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters import write_record
from rsea_ros.errors import IdentificationError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import measure, simulate
from rsea_ros.records.record import Channel, FloatArray, Record

CHANNELS = ("ft", "position", "velocity", "motor_torque", "deflection")
OF_SPRING = ("ft", "deflection")
"""Channels that a simulation of a rig without a spring lacks."""
FEWEST = 10
"""Samples of a command: fewer are refused by the package's excitations, but may stand in a bag."""
TARGETS = {True: 0.02, False: 1e-3}
"""rad of reference for each N m of a case's command, with and without a position loop in the rig."""
MISFIT = 1.6
"""Factors of the bench's damping and inertia over the rig's, in cases with another bench."""


def sensors_of(rig: Rig, stated: str) -> Rig:
    """Return the rig with each sensor's noise stated, zero, left out, or one of each by turns."""
    kept = {}
    for k, (name, sensor) in enumerate(rig.sensors.items()):
        kind = ("stated", "zero", "left out")[k % 3] if stated == "mixed" else stated
        if kind != "left out":
            kept[name] = replace(sensor, noise=0.0, quantum=0.0) if kind == "zero" else sensor
    return replace(rig, sensors=kept)


def command_of(case: Mapping[str, Any], rate: float, duration: float) -> FloatArray:
    """Return the command of a case, N m."""
    size = max(round(rate * duration), 3)
    kind = case["command"]
    t = np.arange(size) / rate
    if kind in ("white_noise", "chirp") and size < FEWEST:
        return _noise(size)
    if kind in ("white_noise", "chirp"):
        band = {"low": min(0.05, rate / 50.0), "high": 0.4 * rate}
        return excitation(kind, ExcitationSettings(rate=rate, duration=size / rate, seed=3, **band))
    made: dict[str, Callable[[], FloatArray]] = {
        "constant": lambda: np.full(size, 5.0),
        "zero": lambda: np.zeros(size),
        "huge": lambda: np.where(t > 0.9 * duration, 1e308, np.sin(t)),
        "tiny": lambda: 1e-300 * np.sin(5.0 * t),
        "sine": lambda: 20.0 * np.sin(2.0 * np.pi * 0.05 * rate * t),
        "steps": lambda: 10.0 * np.sign(np.sin(2.0 * np.pi * t / max(4.0, 8.0 / rate))),
        "slow": lambda: 20.0 * np.sin(2.0 * np.pi * t / duration),
        "resting": lambda: np.where(np.floor(t / duration * 6) % 2 == 0, 0.0, _noise(size)),
        "single": lambda: 20.0 * (np.arange(size) == size // 2),
    }
    return made[kind]()


COMMANDS = (
    "white_noise", "chirp", "constant", "zero", "huge", "tiny", "sine", "steps", "slow", "resting", "single",
)  # fmt: skip


def _noise(size: int) -> FloatArray:
    return 10.0 * np.random.default_rng(5).standard_normal(size)


def bag_of(case: Mapping[str, Any], folder: Path) -> tuple[Path, Path]:
    """Write the bag and the rig file of a case; return both paths."""
    stated = load_rig(case["rig"])
    rig = sensors_of(stated, case["sensors"])
    save_rig(rig, folder / "rig.yaml")
    suffix = case.get("storage", ".mcap")
    write_record(record_of(case, stated), folder / f"bag{suffix}")
    return folder / f"bag{suffix}", folder / "rig.yaml"


def record_of(case: Mapping[str, Any], rig: Rig) -> Record:
    """Return the record of a case: simulated, sensors' noise added, damaged."""
    rate, duration = case["rate"], case["duration"]
    with np.errstate(all="ignore"):
        u = command_of(case, rate, duration)
        t = np.arange(len(u)) / rate
        stamps = (np.arange(max(3, round(len(u) * case["states"]))) + 1.0) / (rate * case["states"])
        blank = np.zeros(len(stamps))
        channels = {"command": Channel(t, u)}
        names = [n for n in case["channels"] if not (n in OF_SPRING and rig.rigid_spring)]
        channels |= {n: Channel(t + 1.0 / rate if n == "ft" else stamps, blank[: len(stamps)])
                     for n in names if n != "ft"}  # fmt: skip
        if "ft" in names:
            channels["ft"] = Channel(t + 1.0 / rate, np.zeros(len(t)))
        targets = Channel(t, TARGETS[rig.loop is not None] * u)
        asked = Record({**channels, "reference": targets})
        measured = _measure(asked, _bench(rig, case["bench"]), case["noise"])
        if "ft" in case["channels"] and rig.rigid_spring:
            measured["ft"] = Channel(t + 1.0 / rate, 0.01 * _noise(len(t)))
        record = Record({"command": channels["command"], **measured}, epoch_ns=case["epoch"])
        if case["loop"] and rig.controller is not None:
            record = record.with_channels(reference=targets)
        return STAMPS[case["stamps"]](SENSORS[case["dead"]](record))


def _bench(rig: Rig, bench: str) -> Rig:
    if bench == "as stated":
        return rig
    names = [n for n in ("rotor.reflected_damping", "rotor.reflected_inertia") if n in rig.quantities]
    rig = rig.with_values({n: MISFIT * rig[n] for n in names})
    return rig.with_effects(*rig.effects, EffectSetting("mains_interference", {}))


def _measure(asked: Record, rig: Rig, noise: bool) -> dict[str, Channel]:
    rng = np.random.default_rng(11)
    effects = tuple(e for e in rig.effects if e.name != "mains_interference")
    try:
        driven = replace(rig, effects=effects, controller=rig.controller if rig.loop else None)
        true = simulate(driven, asked)
    except IdentificationError:  # too short for a simulation: sensors at rest
        true = {n: np.zeros(len(c)) for n, c in asked.channels.items() if n in CHANNELS}
    hum = len(effects) < len(rig.effects)
    measured = {}
    for n, y in true.items():
        t = asked[n].t
        y = y + hum * 0.05 * float(np.std(y)) * np.sign(np.sin(3.0 * t)) if np.isfinite(y).all() else y
        measured[n] = Channel(t, measure(rig, n, y, rng) if noise else y)
    return measured


def _each(change: Callable[[Channel], Channel], *names: str) -> Callable[[Record], Record]:
    def changed(record: Record) -> Record:
        chosen = [n for n in record.channels if not names or n in names]
        return record.with_channels(**{n: change(record[n]) for n in chosen})

    return changed


def _step(c: Channel, by: float) -> Channel:
    return Channel(np.where(np.arange(len(c)) > len(c) // 2, c.t + by, c.t), c.y)


def _gap(c: Channel, share: float) -> Channel:
    span = float(c.t[-1] - c.t[0])
    keep = np.abs(c.t - c.t[0] - 0.5 * span) > 0.5 * share * span
    return Channel(c.t[keep], c.y[keep])


def _jitter(c: Channel) -> Channel:
    step = float(np.median(np.diff(c.t)))
    return Channel(c.t + 0.4 * step * np.random.default_rng(2).uniform(-1, 1, len(c)), c.y)


def _late(c: Channel) -> Channel:
    return Channel(c.t + 1e5, c.y)


STAMPS: Mapping[str, Callable[[Record], Record]] = {
    "even": lambda r: r,
    "hour forward": _each(lambda c: _step(c, 3600.0)),
    "year forward": _each(lambda c: _step(c, 3.15e7)),
    "states hour forward": _each(lambda c: _step(c, 3600.0), *CHANNELS),
    "command hour forward": _each(lambda c: _step(c, 3600.0), "command"),
    "back": _each(lambda c: _step(c, -0.3 * float(c.t[-1] - c.t[0]))),
    "gap": _each(lambda c: _gap(c, 0.1)),
    "wide gap": _each(lambda c: _gap(c, 0.8)),
    "gap of states": _each(lambda c: _gap(c, 0.3), *CHANNELS),
    "jitter": _each(_jitter),
    "same": _each(lambda c: Channel(np.full(len(c), c.t[0]), c.y)),
    "apart": _each(_late, *CHANNELS),
    "repeated": _each(lambda c: Channel(np.repeat(c.t[::2], 2)[: len(c)], c.y)),
}


def _hold(c: Channel, value: float) -> Channel:
    return Channel(c.t, np.full(len(c), value))


def _freeze(c: Channel) -> Channel:
    return Channel(c.t, np.where(np.arange(len(c)) > len(c) // 3, c.y[len(c) // 3], c.y))


def _spike(c: Channel, value: float) -> Channel:
    return Channel(c.t, np.where(np.arange(len(c)) == len(c) // 2, value, c.y))


SENSORS: Mapping[str, Callable[[Record], Record]] = {
    "none": lambda r: r,
    "all still": _each(lambda c: _hold(c, 0.125), *CHANNELS),
    "all zero": _each(lambda c: _hold(c, 0.0), *CHANNELS),
    "ft zero": _each(lambda c: _hold(c, 0.0), "ft"),
    "ft constant": _each(lambda c: _hold(c, 1.7), "ft"),
    "position zero": _each(lambda c: _hold(c, 0.0), "position"),
    "velocity zero": _each(lambda c: _hold(c, 0.0), "velocity"),
    "motor torque zero": _each(lambda c: _hold(c, 0.0), "motor_torque"),
    "frozen": _each(_freeze, "ft", "position"),
    "nan": _each(lambda c: _spike(c, np.nan), *CHANNELS),
    "infinite": _each(lambda c: _spike(c, np.inf), "ft", "velocity"),
    "1e308": _each(lambda c: _spike(c, 1e308), *CHANNELS),
    "all 1e300": _each(lambda c: Channel(c.t, c.y * 1e300), *CHANNELS),
    "all 1e-300": _each(lambda c: Channel(c.t, c.y * 1e-300), *CHANNELS),
    "few": _each(lambda c: Channel(c.t[:5], c.y[:5]), *CHANNELS),
    "nan all": _each(lambda c: _hold(c, np.nan), "ft", "velocity"),
    "command nan": _each(lambda c: _spike(c, np.nan), "command"),
    "squared": _each(lambda c: Channel(c.t, np.abs(c.y)), *CHANNELS),
}
