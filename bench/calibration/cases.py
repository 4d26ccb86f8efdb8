"""Records for the calibration of probabilities: several plants, overlapping effects, laws of no catalogue.

The plants `open`, `loop`, `sea` and `rigid` are rigs of this project with drawn values, simulated by it,
with laws that the catalogue lacks put into the command or the sensors; `second` is test/independent, which
shares no code with it and has such laws in its mechanics too. Coefficients are fitted on the former and
judged on the latter.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from independent.bench import drawn_bench, record_command
from independent.excitations import chirp_noise, odd_multisine
from independent.hidden import OFF_CATALOGUE
from independent.severities import SEVERITIES, SIZES, drawn_parameters

from bench.calibration.laws import LAWS, RATE
from bench.diagnosis.cases import RIG, hide_all, kin_of
from bench.diagnosis.commands import work
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig import PositionLoop, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import measure, simulate
from rsea_ros.records.record import Channel, FloatArray, Record

FAMILIES = ("open", "second", "loop", "second", "sea", "second", "rigid", "second")
"""Plants in the order in which records are made; `second` judges the others."""
IN_LOOP = ("loop", "rigid")
"""Plants that a position loop drives."""
GROUPS = {
    "one": 0.15,
    "two": 0.22,
    "three": 0.10,
    "four": 0.03,
    "off": 0.15,
    "off_and_one": 0.18,
    "off_and_two": 0.08,
    "taken_out": 0.08,
    "clean": 0.01,
}
"""Share of the records by hidden causes: effects of the catalogue, a law that it lacks (off), or both."""
COUNT = {"one": 1, "two": 2, "three": 3, "four": 4, "off_and_one": 1, "off_and_two": 2, "taken_out": 2}
ON_RIGID = ("coulomb_friction", "stribeck_friction", "asymmetric_friction", "torque_ripple", "damping_drift")
NOT_ON_SEA = ("torque_constant_error", "current_loop_lag", "hard_stop")
"""Effects that a machine without a measured motor torque cannot tell, or that its travel never meets."""


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
    return Plan(
        name=f"{k:04d}-{family}-{group}",
        family=family,
        group=group,
        seed=int(rng.integers(1, 2**31)),
        excitation=str(rng.choice(kinds)),
        duration=float(rng.choice((10.0, 12.0))),
        hidden=hidden,
        off=off,
        without=kin_of(names[0]) if group == "taken_out" else (known,) if known in catalogue() else (),
        coloured=float(rng.choice((0.0, 0.0, 0.05, 0.2))),
    )


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
    return _second(plan, rng) if plan.family == "second" else _simulate(plan, rng)


def _command(plan: Plan, rng: np.random.Generator) -> FloatArray:
    """Return the commands of a plan, N m."""
    if plan.excitation == "chirp":
        return chirp_noise(plan.duration, rng)
    if plan.excitation == "multisine":
        return odd_multisine(plan.duration, rng, period=5.0 if plan.duration != 12.0 else 4.0)
    levels = 30.0 * work(plan.duration, rng, smooth=plan.excitation == "work")
    noise = 0.0 if plan.family in IN_LOOP else 1.0  # no loop has white noise in its reference
    return levels + noise * rng.normal(size=len(levels))


def _second(plan: Plan, rng: np.random.Generator) -> tuple[Record, Rig]:
    bench = hide_all(drawn_bench(rng), plan.hidden, plan.off)
    record = record_command(bench, _command(plan, rng), rng)
    return _with_colour(record, plan, rng), load_rig(RIG)


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
    acting = law.command(commanded, plan.off[1]) if law and law.command and plan.off else commanded
    names, late = [n for n in stated.sensors if n != "reference"], t + 1.0 / RATE
    channels = {"command": Channel(t, acting), **{n: Channel(late, np.zeros(len(t))) for n in names}}
    if plan.family in IN_LOOP:  # with a reference, rad, that demands about the commanded torque
        softness = 2.0 / true["spring.stiffness"] if not true.rigid_spring else 0.02
        channels |= {"command": Channel(t, acting - commanded), "reference": Channel(t, softness * commanded)}
    outputs = simulate(true, Record(channels, plan.name))
    measured = {n: measure(true, n, outputs[n], rng) for n in names}
    if law and law.sensor and plan.off:
        measured = law.sensor(measured, plan.off[1], t, rng)
    channels |= {n: Channel(late, y) for n, y in measured.items()}
    in_loop = Channel(late, measured["motor_torque"]) if plan.family in IN_LOOP else Channel(t, commanded)
    return _with_colour(Record(channels | {"command": in_loop}, plan.name), plan, rng), stated


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


def _with_colour(record: Record, plan: Plan, rng: np.random.Generator) -> Record:
    """Return the record with noise of the F/T sensor that falls with frequency, as of an amplifier."""
    if not plan.coloured or "ft" not in record:
        return record
    white = rng.normal(size=len(record["ft"]))
    slow = np.convolve(white, np.exp(-np.arange(40) / 8.0), mode="same")
    ft = record["ft"].y + plan.coloured * slow / slow.std()
    return record.with_channels(ft=Channel(record["ft"].t, ft))
