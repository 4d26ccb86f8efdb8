"""Records for the calibration of probabilities: several plants, overlapping effects, laws of no catalogue.

The plants `open`, `loop`, `sea` and `rigid` are rigs of this project with drawn values, simulated by it,
with laws that the catalogue lacks put into the command or the sensors; `second` is test/independent, which
shares no code with it and has such laws in its mechanics too. Coefficients are fitted on the former and
judged on the latter.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.excitations import chirp_noise, odd_multisine
from independent.hidden import OFF_CATALOGUE
from independent.severities import SEVERITIES, SIZES, drawn_parameters
from scipy.signal import cont2discrete, lfilter

from bench.diagnosis.cases import RIG, hide_all, kin_of
from bench.diagnosis.commands import work
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig import PositionLoop, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import measure, simulate
from rsea_ros.records.record import Channel, FloatArray, Record

RATE = 280.0
"""Hz, of all records."""
FAMILIES = ("open", "second", "loop", "second", "sea", "second", "rigid", "second")
"""Plants in the order in which records are made; `second` judges the others."""
IN_LOOP = ("loop", "rigid")
"""Plants that a position loop drives."""
GROUPS = {
    "one": 0.15, "two": 0.22, "three": 0.10, "four": 0.03, "off": 0.15, "off_and_one": 0.18,
    "off_and_two": 0.08, "taken_out": 0.08, "clean": 0.01,
}  # fmt: skip
"""Share of the records by hidden causes: effects of the catalogue, a law that it lacks (off), or both."""
COUNT = {"one": 1, "two": 2, "three": 3, "four": 4, "off_and_one": 1, "off_and_two": 2, "taken_out": 2}
ON_RIGID = ("coulomb_friction", "stribeck_friction", "asymmetric_friction", "torque_ripple", "damping_drift")
NOT_ON_SEA = ("torque_constant_error", "current_loop_lag", "hard_stop")
"""Effects that a machine without a measured motor torque cannot tell, or that its travel never meets."""


@dataclass(frozen=True)
class Law:
    """A law outside the catalogue, in the command before it acts or in the sensors' values.

    on: the plants that show it. known_as: its effect of the catalogue, which then is left out of the search.
    """

    on: tuple[str, ...]
    command: Callable[[FloatArray, float], FloatArray] | None = None
    sensor: Callable | None = None
    known_as: str = ""


def _rate_limit(u: FloatArray, size: float) -> FloatArray:
    step, out = 1500.0 / size / RATE, np.empty_like(u)
    last = 0.0
    for k, wanted in enumerate(u):
        last += min(max(wanted - last, -step), step)
        out[k] = last
    return out


def _overshoot(u: FloatArray, size: float) -> FloatArray:
    w, zeta = 2.0 * np.pi * 40.0, 0.5 / (1.0 + size)
    b, a, _ = cont2discrete(([w * w], [1.0, 2.0 * zeta * w, w * w]), 1.0 / RATE)
    return lfilter(b.ravel(), a, u)


def _sensor(channel: str, error: Callable[..., FloatArray]) -> Callable:
    def apply(measured, size, t, rng):
        y = measured[channel]
        return {**measured, channel: y + size * error(y, t, rng)}

    return apply


def _walk(rng: np.random.Generator, y: FloatArray) -> FloatArray:
    return np.cumsum(rng.normal(size=len(y))) / np.sqrt(RATE)


DRIVEN, WITH_FT = ("open", "sea"), ("open", "sea", "loop")
FT: Mapping[str, tuple[Callable[..., FloatArray], str]] = {
    "quadratic_ft": (lambda y, t, rng: 0.004 * y**2, ""),
    "thermal_ft": (lambda y, t, rng: -np.expm1(-t / (0.2 * t[-1])), "ft_drift"),
    "walking_ft": (lambda y, t, rng: 0.15 * _walk(rng, y), ""),
    "cubic_ft": (lambda y, t, rng: 2.0e-4 * y**3 / (1.0 + 0.01 * y**2), ""),
}
TORQUE: Mapping[str, Callable[..., FloatArray]] = {
    "torque_by_position": lambda y, t, rng: 1.5 * np.sin(2.0 * np.pi * t / 1.7),
    "torque_squared": lambda y, t, rng: 0.01 * y * np.abs(y),
    "torque_walk": lambda y, t, rng: 0.5 * _walk(rng, y),
}
LAWS = {
    "dead_zone": Law(
        DRIVEN, lambda u, size: np.sign(u) * np.maximum(np.abs(u) - 3.0 * size, 0.0), known_as="dead_zone"
    ),
    "rate_limit": Law(DRIVEN, command=_rate_limit),
    "fade": Law(
        DRIVEN, lambda u, size: u * (1.0 - 0.2 * size * np.linspace(0.0, 1.0, len(u))),
        known_as="torque_constant_drift",
    ),
    "one_sided_gain": Law(DRIVEN, lambda u, size: np.where(u > 0.0, (1.0 + 0.12 * size) * u, u)),
    "overshoot": Law(DRIVEN, command=_overshoot, known_as="current_loop_overshoot"),
    **{name: Law(WITH_FT, sensor=_sensor("ft", law), known_as=known) for name, (law, known) in FT.items()},
    "eccentric_encoder": Law(
        WITH_FT, sensor=_sensor("position", lambda y, t, rng: 1.0e-4 * np.sin(502.0 * y)),
        known_as="encoder_eccentricity",
    ),
    **{name: Law(("rigid",), sensor=_sensor("motor_torque", law)) for name, law in TORQUE.items()},
}  # fmt: skip
"""Laws outside the catalogue by name."""


@dataclass(frozen=True)
class Plan:
    """What a record is made from.

    hidden: effects with their parameters. off: a law outside the catalogue and its relative size. without:
    effects that the diagnosis may not use. coloured: N m RMS of such noise in the F/T sensor.
    """

    name: str
    family: str
    group: str
    seed: int
    excitation: str
    duration: float
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    off: tuple[str, float] | None = None
    without: tuple[str, ...] = ()
    coloured: float = 0.0

    @property
    def truth(self) -> tuple[str, ...]:
        """Names that are right."""
        return tuple(n for n in self.hidden if n not in self.without)


def plans(count: int, seed: int) -> list[Plan]:
    """Return the plans of so many records; a larger count begins with the same ones."""
    return [_plan(k, np.random.default_rng([seed, k])) for k in range(count)]


def _plan(k: int, rng: np.random.Generator) -> Plan:
    family = FAMILIES[k % len(FAMILIES)]
    group = str(rng.choice(list(GROUPS), p=np.array(list(GROUPS.values())) / sum(GROUPS.values())))
    names = _drawn_effects(family, COUNT.get(group, 0), rng)
    hidden = {n: _sizes(n, family, rng) for n in names}
    off = None
    if group.startswith("off"):
        laws = list(OFF_CATALOGUE) if family == "second" else [n for n, f in LAWS.items() if family in f.on]
        off = (str(rng.choice(laws)), float(rng.choice((0.5, 1.0, 1.6)) * rng.uniform(0.8, 1.2)))
    known = LAWS[off[0]].known_as if off and family != "second" else ""  # not for the diagnosis to use
    kinds = ("work", "work", "steps") if family in IN_LOOP else ("chirp", "multisine", "work")
    without = kin_of(names[0]) if group == "taken_out" else (known,) if known in catalogue() else ()
    seed, excitation = int(rng.integers(1, 2**31)), str(rng.choice(kinds))
    duration, coloured = float(rng.choice((10.0, 12.0))), float(rng.choice((0.0, 0.0, 0.05, 0.2)))
    name = f"{k:04d}-{family}-{group}"
    return Plan(name, family, group, seed, excitation, duration, hidden, off, without, coloured)


def _sizes(name: str, family: str, rng: np.random.Generator) -> dict[str, float]:
    """Return parameters of an effect; a drive without a spring works against larger torques."""
    drawn = drawn_parameters(name, str(rng.choice(SEVERITIES, p=(0.35, 0.4, 0.25))), rng)
    torques = {p.name for p in catalogue()[name].parameters if p.unit == "N m"}
    return {p: v * (6.0 if family == "rigid" and p in torques else 1.0) for p, v in drawn.items()}


def _drawn_effects(family: str, count: int, rng: np.random.Generator) -> list[str]:
    """Return effects that are not confused with each other, of those that a plant can show."""
    possible = [n for n in SIZES if family != "rigid" or n in ON_RIGID]
    possible = [n for n in possible if family != "sea" or n not in NOT_ON_SEA]
    chosen: list[str] = []
    for name in rng.permutation(possible):
        if len(chosen) < count and not {*kin_of(name)[1:]} & {*chosen}:
            chosen.append(str(name))
    return chosen


def simulate_plan(plan: Plan) -> tuple[Record, Rig]:
    """Simulate a plan; return the record and the rig that a user would diagnose it with."""
    rng = np.random.default_rng(plan.seed)
    if plan.family == "second":
        bench = hide_all(drawn_bench(rng), plan.hidden, plan.off)
        record, rig = record_command(bench, _command(plan, rng), rng), load_rig(RIG)
    else:
        record, rig = _simulate(plan, rng)
    if not plan.coloured or "ft" not in record:
        return record, rig
    white = rng.normal(size=len(record["ft"]))  # noise that falls with frequency, as of an amplifier
    slow = np.convolve(white, np.exp(-np.arange(40) / 8.0), mode="same")
    ft = record["ft"].y + plan.coloured * slow / slow.std()
    return record.with_channels(ft=Channel(record["ft"].t, ft)), rig


def _command(plan: Plan, rng: np.random.Generator) -> FloatArray:
    """Return the commands of a plan, N m."""
    if plan.excitation == "chirp":
        return chirp_noise(plan.duration, rng)
    if plan.excitation == "multisine":
        return odd_multisine(plan.duration, rng, period=5.0 if plan.duration != 12.0 else 4.0)
    levels = 30.0 * work(plan.duration, rng, smooth=plan.excitation == "work")
    noise = 0.0 if plan.family in IN_LOOP else 1.0  # no loop has white noise in its reference
    return levels + noise * rng.normal(size=len(levels))


def _simulate(plan: Plan, rng: np.random.Generator) -> tuple[Record, Rig]:
    """Return a record of one of the project's rigs with drawn values, and the rig as stated."""
    stated = rig_of(plan.family)
    true = stated.with_values(
        {n: stated[n] * float(np.exp(0.5 * stated.spread(n) * rng.normal())) for n in stated.free()}
    )
    for name, parameters in plan.hidden.items():
        true = true.with_effect(name, **parameters)
    law = LAWS[plan.off[0]] if plan.off else None
    t = np.arange(round(plan.duration * RATE)) / RATE
    commanded = _command(plan, rng)
    acting = law.command(commanded, plan.off[1]) if law and law.command else commanded
    names, late = [n for n in stated.sensors if n != "reference"], t + 1.0 / RATE
    channels = {"command": Channel(t, acting), **{n: Channel(late, np.zeros(len(t))) for n in names}}
    if plan.family in IN_LOOP:  # with a reference, rad, that demands about the commanded torque
        softness = 2.0 / true["spring.stiffness"] if not true.rigid_spring else 0.02
        channels |= {"command": Channel(t, acting - commanded), "reference": Channel(t, softness * commanded)}
    outputs = simulate(true, Record(channels, plan.name))
    measured = {n: measure(true, n, outputs[n], rng) for n in names}
    if law and law.sensor:
        measured = law.sensor(measured, plan.off[1], t, rng)
    channels |= {n: Channel(late, y) for n, y in measured.items()}
    in_loop = Channel(late, measured["motor_torque"]) if plan.family in IN_LOOP else Channel(t, commanded)
    return Record(channels | {"command": in_loop}, plan.name), stated


def rig_of(family: str) -> Rig:
    """Return the rig of a family as a user would state it."""
    if family == "rigid":
        return replace(load_rig("bare_drive"), controller=PositionLoop(15.0, 120.0, 200.0))
    rig = load_rig(RIG)
    if family == "loop":
        return replace(rig, controller=PositionLoop(15.0, 80.0, 80.0))
    if family != "sea":
        return rig
    spreads = {"rotor.reflected_inertia": 1.0, "rotor.reflected_damping": 1.0, "spring.stiffness": 0.2}
    values = {"rotor.reflected_inertia": 0.4, "rotor.reflected_damping": 12.0, "spring.stiffness": 2100.0}
    quantities = {
        n: replace(q, value=values.get(n, q.value), spread=spreads.get(n, q.spread))
        for n, q in rig.quantities.items()
    }
    sensors = {n: s for n, s in rig.sensors.items() if n in ("ft", "position")}
    return replace(rig, quantities=quantities, sensors=sensors)
