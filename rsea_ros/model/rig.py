"""The rig: what the bench is, its values with spread and source, and whether its parts fit together.

FIELDS is the only list of the values that a rig may have, by the dotted names of the YAML file
(`rotor.reflected_inertia`), with unit, smallest value and default. `rig_file.py` reads and writes files.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from types import MappingProxyType
from typing import Literal

import numpy as np

from rsea_ros.documents.units import plain, with_unit
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import RigError
from rsea_ros.model.sensor_filter import SensorFilter
from rsea_ros.model.train import PARTS, TRAINS, Part, Train
from rsea_ros.records.record import ComplexArray, FloatArray

LEAST_SIZE, GREATEST_SIZE = 1e-12, 1e12
"""Limits of the size of a nonzero value; beyond them the equations have no accurate digit."""
END_NAMES = ("housing_end", "spring_end")


@dataclass(frozen=True)
class Field:
    """A possible value of a rig: unit, lower bound, whether the bound is allowed, default."""

    unit: str
    low: float = 0.0
    low_allowed: bool = True
    default: float | None = None


_END_FIELDS = {
    "inertia": Field("kg m^2", low_allowed=False),
    "damping": Field("N m s/rad", default=0.0),
    "stiffness": Field("N m/rad", default=0.0),
    "gravity": Field("N m", default=0.0),
    "gravity_angle": Field("rad", low=-math.inf, default=0.0),
}

LOOP_FIELDS: Mapping[str, Mapping[str, Field]] = {
    "p": {"k_p": Field("N m/rad")},
    "pd": {
        "k_p": Field("N m/rad"),
        "k_i": Field("N m/rad/s", default=0.0),
        "k_d": Field("N m s/rad", default=0.0),
        "k_f": Field("N m s/rad", default=0.0),
    },
    "mit": {"k_p": Field("N m/rad"), "k_d": Field("N m s/rad", default=0.0)},
    "cascade": {
        "k_pos": Field("1/s"),
        "k_v": Field("N m s/rad"),
        "k_vi": Field("N m/rad", default=0.0),
    },
}
"""Gains of the kinds of position loop (model/position_loop.py)."""
_LIMIT_FIELDS = {
    "torque_limit": Field("N m", low_allowed=False, default=math.inf),
    "velocity_limit": Field("rad/s", low_allowed=False, default=math.inf),
    "sample_time": Field("s", default=0.0),
}


def loop_names(kind: str) -> tuple[str, ...]:
    """Return the gains and limits that a kind of position loop may have."""
    limits = (name for name in _LIMIT_FIELDS if kind != "mit" or name != "velocity_limit")
    return *LOOP_FIELDS[kind], *limits


FIELDS: Mapping[str, Field] = {
    "rotor.reflected_inertia": Field("kg m^2", low_allowed=False),
    "rotor.reflected_damping": Field("N m s/rad"),
    "gear.ratio": Field("1", low=1.0, default=1.0),
    "gear.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
    "gear.damping": Field("N m s/rad", default=0.0),
    "chassis.inertia": Field("kg m^2", default=0.0),
    "spring.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
    "spring.damping": Field("N m s/rad", default=0.0),
    "housing.inertia": Field("kg m^2", default=0.0),
    "proximal_spring.stiffness": Field("N m/rad", low_allowed=False, default=math.inf),
    "proximal_spring.damping": Field("N m s/rad", default=0.0),
    **{f"{end}.{key}": f for end in END_NAMES for key, f in _END_FIELDS.items()},
    **{f"controller.{key}": f for gains in LOOP_FIELDS.values() for key, f in gains.items()},
    **{f"controller.{key}": f for key, f in _LIMIT_FIELDS.items()},
    "spring_end.above_sensor": Field("1", default=0.0),
}


def unit_of(name: str) -> str:
    """Return the unit of a rig field. Raises RigError for an unknown name."""
    if name not in FIELDS:
        raise RigError(f"{name}: no such rig field, expected one of {', '.join(FIELDS)}")
    return FIELDS[name].unit


def check_value(name: str, value: float, where: str = "rig") -> None:
    """Raise RigError when a value is not a possible one for its field."""
    if name in FIELDS and LEAST_SIZE <= value <= GREATEST_SIZE and value > FIELDS[name].low:
        return  # as nearly always: a fit asks for every value of every simulation
    unit = unit_of(name)
    low, allowed = FIELDS[name].low, FIELDS[name].low_allowed
    infinite_ok = FIELDS[name].default == math.inf
    possible = (value >= low if allowed else value > low) and (math.isfinite(value) or infinite_ok)
    if possible and (LEAST_SIZE <= abs(value) <= GREATEST_SIZE or value == 0.0 or not math.isfinite(value)):
        return
    stated = f"{where}: {name} = {value:g}"
    if possible:
        sizes = with_unit(f"a size between {LEAST_SIZE:g} and {GREATEST_SIZE:g}", unit)
        raise RigError(f"{with_unit(stated, unit)}, expected {sizes}", name)
    bound = with_unit(f">= {low:g}" if allowed else f"> {low:g}", unit)
    raise RigError(f"{with_unit(stated, unit)}, expected a finite value {bound}", name)


MOTOR_TORQUE = 68.0
"""N m, where a rig states no motor: the paper's (H54-200-S500-R) makes 68.19 at its limit of 9.99 A."""
CLOCK_DOUBT = 1e-4
"""s, one sigma of the time offset of a sensor if the rig states none."""
Hold = Literal["zero", "first", "band"]
HOLDS: tuple[Hold, ...] = ("zero", "first", "band")


@dataclass(frozen=True)
class Quantity:
    """A value in SI, its relative prior uncertainty (one sigma), and its source."""

    value: float
    spread: float = 0.0
    source: str = ""
    ci95: tuple[float, float] | None = None


_UNSTATED = Quantity(0.0)


_SLOWLY = 1e-3
"""Hz, against every filter."""


@dataclass(frozen=True)
class Sensor:
    """Noise (one sigma) and quantum of a channel, in the channel's unit (see signals.UNITS).

    zero_unknown: the zero differs from record to record (an encoder that counts from power-on), so only
    changes of its values count. clock: s, delay of the reading after its stamp at the start of a record;
    clock_rate: ppm, growth of that delay with time. clock_doubt: s, one sigma of `clock`, which a fit
    estimates. delay: s, known, by which the reading is older than that, as by a bus. filter: known; what it
    logs has passed it, noise too, and then has steps of its quantum.
    """

    noise: float = 0.0
    quantum: float = 0.0
    zero_unknown: bool = False
    clock: float = 0.0
    clock_doubt: float = CLOCK_DOUBT
    clock_rate: float = 0.0
    delay: float = 0.0
    filter: SensorFilter | None = None

    @property
    def level(self) -> float:
        """The RMS of noise and rounding together: the error of a rounded value is even over a quantum."""
        return math.hypot(self.noise, self.quantum / math.sqrt(12.0))

    def response(self, hz: FloatArray, period: float) -> ComplexArray:
        """Return its delay and filter at frequencies, Hz, shape (n,). period: of its samples, s."""
        late: ComplexArray = np.exp(-2j * np.pi * self.delay * hz)
        return late if self.filter is None else late * self.filter.response(hz, period)

    def lag(self, period: float) -> float:
        """Return by how much a slow reading is late by delay and filter, s. period: of its samples, s."""
        return float(-np.angle(self.response(np.array([_SLOWLY]), period))[0] / (2.0 * math.pi * _SLOWLY))


@dataclass(frozen=True)
class EffectSetting:
    """An active effect of the catalogue, with its parameters in SI.

    guess: the effect is an initial guess of a fit, not a known property; a diagnosis has to find it.
    """

    name: str
    parameters: Mapping[str, float]
    guess: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))


@dataclass(frozen=True)
class Condition:
    """What differs in one record of a machine, known by the last part of its path.

    values: replace the rig's; a fit moves those with a spread, for this record alone. added: to the rig's
    value or what a fit makes of it, SI: a payload. without: names of effects that do not act in it.
    """

    record: str
    values: Mapping[str, Quantity] = field(default_factory=dict)
    added: Mapping[str, float] = field(default_factory=dict)
    without: frozenset[str] = frozenset()

    def moved(self, values: Mapping[str, float]) -> Condition:
        """Return the condition with some of its values replaced (SI, by names as `spring.damping@cold`)."""
        moved = {n: values.get(f"{n}@{self.record}", q.value) for n, q in self.values.items()}
        return replace(self, values={n: replace(q, value=moved[n]) for n, q in self.values.items()})


def field_of(name: str) -> str:
    """Return the field of a value, `spring.damping` of `spring.damping@cold` too: of that record alone."""
    return name.partition("@")[0]


@dataclass(frozen=True)
class PositionLoop:
    """Position loop that was active during the record: command = k_v (k_p (reference - q) - dq/dt).

    k_p: 1/s; k_v: N m s/rad; limit: N m on the command.
    """

    k_p: float
    k_v: float
    limit: float = math.inf


@dataclass(frozen=True)
class Rig:
    """A description of a bench. See the module docstring.

    linear: linear motion; m, N and kg replace rad, N m and kg m^2. other_trains: other possible gear
    trains. beside_spring: which part turns the spring (train.py); position and motor torque are those of
    that part against the other, chassis.inertia is its. known: names that no fit may change. proximal: the
    end that the paper calls *proximal*. ft_end: the end with the F/T sensor; at the housing end it measures
    the proximal spring, between housing and that end. encoder_end: the part that the encoder measures
    against the housing: the gear output, or the spring end behind backlash and spring. motion: `measured`
    where something else moves the output, and where it is empty for a rigid joint without a loop: then
    torques are judged along the measured motion (model/inverse.py); else `simulated`. loop: kind of the
    position loop whose targets command the bench, a key of LOOP_FIELDS; its gains are among the quantities.
    controller: a loop that added its torque to the command of the record. hold: the command between two
    samples: the first of them, a line between them, or the band-limited curve of an analogue command sampled
    behind a filter. conditions: what differs in some records.
    """

    name: str
    quantities: Mapping[str, Quantity]
    clamped: frozenset[str] = frozenset()
    rigid_spring: bool = False
    linear: bool = False
    train: Train = "planetary"
    other_trains: tuple[Train, ...] = ()
    beside_spring: Part = "chassis"
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    known: frozenset[str] = frozenset()
    proximal: str = "housing_end"
    ft_end: str = "spring_end"
    encoder_end: str = "gear_output"
    motion: str = ""
    loop: str | None = None
    controller: PositionLoop | None = None
    hold: Hold = "zero"
    effects: tuple[EffectSetting, ...] = ()
    conditions: tuple[Condition, ...] = ()
    about: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("quantities", "sensors"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        for name, quantity in self.quantities.items():
            check_value(name, quantity.value, where=self.name)
        check_structure(self)

    def __repr__(self) -> str:
        """Return the name, the values and the effects in one line."""
        values = ", ".join(f"{n} {with_unit(f'{v:.5g}', unit_of(n))}" for n, v in self.values().items())
        effects = ", ".join(effect.name for effect in self.effects) or "none"
        return f"Rig({self.name!r}: {values}; effects: {effects})"

    def __getitem__(self, name: str) -> float:
        """Return a value in SI, or the default of a field that the rig leaves out."""
        if name in self.quantities:
            return self.quantities[name].value
        default = FIELDS[name].default if name in FIELDS else None
        if default is None:
            expected = f"expected a value in {plain(unit_of(name))}"
            raise RigError(f"rig {self.name}: {name} is missing, {expected}", name)
        return default

    def values(self) -> dict[str, float]:
        """Return every stated value by name, SI."""
        return {name: q.value for name, q in self.quantities.items()}

    def with_values(self, values: Mapping[str, float]) -> Rig:
        """Return the rig with some values replaced (SI, by name as in FIELDS); spread and source stay."""
        return self.moved(values, self.effects)

    def moved(self, values: Mapping[str, float], effects: tuple[EffectSetting, ...]) -> Rig:
        """Return the rig with some values replaced and exactly these effects: at once, for fits.

        A name such as `spring.damping@cold` is that of a condition.
        """
        quantities = dict(self.quantities)
        for name, value in values.items():
            if "@" not in name:
                q = quantities.get(name, _UNSTATED)
                quantities[name] = Quantity(float(value), q.spread, q.source, q.ci95)
        conditions = tuple(c.moved(values) for c in self.conditions)
        return replace(self, quantities=quantities, effects=effects, conditions=conditions)

    def of_records(self) -> dict[str, Quantity]:
        """Return the values of single records, by names such as `spring.damping@cold`."""
        return {f"{n}@{c.record}": q for c in self.conditions for n, q in c.values.items()}

    def condition(self, record: str) -> Condition | None:
        """Return what differs in a record, given by its path or the last part of it; None for nothing."""
        return next((c for c in self.conditions if c.record == PurePath(record).name), None)

    def under(self, record: str) -> Rig:
        """Return the rig as it was for a record (see `condition`), without conditions."""
        differs = self.condition(record)
        if differs is None:
            return replace(self, conditions=()) if self.conditions else self
        quantities = {**self.quantities, **differs.values}
        for name, more in differs.added.items():
            quantities[name] = replace(quantities.get(name, _UNSTATED), value=self[name] + more)
        effects = tuple(e for e in self.effects if e.name not in differs.without)
        return replace(self, quantities=quantities, effects=effects, conditions=())

    def with_effects(self, *effects: EffectSetting) -> Rig:
        """Return the rig with exactly these active effects."""
        return replace(self, effects=effects)

    def with_effect(self, name: str, **parameters: float) -> Rig:
        """Return the rig with one more active effect of the catalogue, parameters in SI (docs/effects.md).

        Other parameters have their typical size. Raises ParameterError for an unknown parameter, and for a
        value outside its bounds.
        """
        effect = effect_named(name)
        setting = EffectSetting(name, {**effect.typical, **parameters})
        effect.check(setting.parameters)
        return self.with_effects(*self.effects, setting)

    def free(self) -> tuple[str, ...]:
        """Return the names that a fit may change in every record: those with a spread, but the known ones."""
        return tuple(n for n, q in self.quantities.items() if q.spread > 0.0 and n not in self.known)

    def spread(self, name: str) -> float:
        """Return the relative one-sigma prior spread of a value."""
        return self.quantities[name].spread

    def unit(self, name: str) -> str:
        """Return the unit of a value."""
        return unit_of(name)

    def measures(self, channel: str) -> bool:
        """Return whether a bench of this rig can have a channel; a rigid spring has no ft or deflection."""
        return not (self.rigid_spring and channel in ("ft", "deflection"))

    def zero_unknown(self, channel: str) -> bool:
        """Return whether the zero of a channel's sensor differs from record to record."""
        return channel in self.sensors and self.sensors[channel].zero_unknown

    def clock(self, channel: str, since: FloatArray | float = 0.0) -> FloatArray | float:
        """Return how much later than its stamps a channel is read, s; since: of the record's start, s."""
        sensor = self.sensors.get(channel, Sensor())
        return sensor.clock - sensor.delay + 1e-6 * sensor.clock_rate * since

    def is_on_time(self, channel: str) -> bool:
        """Return whether a channel is read when its stamps say."""
        sensor = self.sensors.get(channel)
        return sensor is None or sensor.clock == sensor.clock_rate == sensor.delay == 0.0

    def filters(self) -> dict[str, SensorFilter]:
        """Return the known filters of its sensors by channel."""
        return {name: sensor.filter for name, sensor in self.sensors.items() if sensor.filter is not None}

    def clock_doubt(self, channel: str) -> float:
        """Return one sigma of the error of a channel's clock beside `clock`, s."""
        return self.sensors[channel].clock_doubt if channel in self.sensors else CLOCK_DOUBT

    def end_is_free(self, end: str) -> bool:
        """Return whether an end can move (it has an inertia of its own)."""
        return end not in self.clamped


def motor_torque(rig: Rig) -> tuple[float, str]:
    """Return the largest torque of the motor at the gear output, N m, and what says so."""
    stated = [(rig["controller.torque_limit"], "controller.torque_limit of the rig")]
    if rig.controller is not None:
        stated.append((rig.controller.limit, "controller.limit of the rig"))
    stated += [
        (effect.parameters["limit"], "torque_saturation of the rig")
        for effect in rig.effects if effect.name == "torque_saturation"
    ]  # fmt: skip
    torque, source = min(stated)
    if math.isinf(torque):
        return MOTOR_TORQUE, "the paper's motor; the rig states none"
    return torque, source


def check_structure(rig: Rig) -> None:
    """Raise RigError where parts of a rig contradict each other, or one is missing."""
    for told, field_name in _contradictions(rig):
        raise RigError(f"rig {rig.name}: {told}", field_name)


def _contradictions(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with expected, and the field. Raises RigError for a value that is missing."""
    for end in set(rig.clamped) - set(END_NAMES):
        yield f"clamped end {end!r}, expected one of {', '.join(END_NAMES)}", ""
    for key, value, allowed in (
        ("gear.train", rig.train, TRAINS), *(("gear.or", train, TRAINS) for train in rig.other_trains),
        ("proximal", rig.proximal, END_NAMES), ("ft_end", rig.ft_end, END_NAMES),
        ("encoder_end", rig.encoder_end, ("gear_output", "spring_end")),
        ("motion", rig.motion or "simulated", ("simulated", "measured")),
        ("beside_spring", rig.beside_spring, PARTS),
    ):  # fmt: skip
        if value not in allowed:
            yield f"{key} = {value!r}, expected one of {', '.join(allowed)}", key
    if rig.beside_spring == "housing" and rig["housing.inertia"]:
        expected = "expected it as chassis.inertia: that of the part beside the spring"
        yield f"housing.inertia with beside_spring: housing, {expected}", "housing.inertia"
    if rig.ft_end == "housing_end" and math.isinf(rig["proximal_spring.stiffness"]):
        expected = "expected that of the sensor, N·m/rad"
        yield f"ft_end = housing_end without proximal_spring.stiffness, {expected}", ""
    if rig.rigid_spring and "spring_end" in rig.clamped and math.isinf(rig["gear.stiffness"]):
        yield "spring rigid and spring_end clamped, expected one of them: nothing could move", ""
    if not rig.rigid_spring and math.isinf(rig["spring.stiffness"]):
        value = "= inf" if "spring.stiffness" in rig.quantities else "is missing"
        yield f"spring.stiffness {value}, expected a value in N·m/rad or `rigid: true`", "spring.stiffness"
    for name in ("rotor.reflected_inertia", "rotor.reflected_damping"):
        rig[name]
    yield from _of_loop(rig)
    for what, is_so in {
        "a rigid spring, which is judged so by itself": rig.rigid_spring,
        "a position loop": rig.loop is not None,
        "a housing that moves": rig.end_is_free("housing_end"),
        "a gear that gives": not math.isinf(rig["gear.stiffness"]),
        "the F/T sensor at the housing": rig.ft_end != "spring_end",
    }.items():  # what torques along a measured motion cannot be told of
        if is_so and rig.motion == "measured":
            yield f"motion = measured with {what}, expected simulated", "motion"
    for end in END_NAMES:
        if rig.end_is_free(end):
            rig[f"{end}.inertia"]


def _of_loop(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with a position loop: kind, gains and limits; a MIT frame has gains of its own."""
    stated = [n.split(".")[1] for n in rig.quantities if n.startswith("controller.")]
    kinds = f"expected one of {', '.join(LOOP_FIELDS)}"
    if rig.loop is None:
        if stated:
            yield f"controller.{stated[0]} without controller.kind, {kinds}", "controller"
        return
    if rig.loop not in LOOP_FIELDS:
        yield f"controller.kind = {rig.loop!r}, {kinds}", "controller.kind"
    allowed = loop_names(rig.loop)
    for name in (name for name in stated if name not in allowed):
        expected = f"expected {', '.join(allowed)}"
        yield f"controller.{name} in a {rig.loop} loop, {expected}", f"controller.{name}"
    for name in LOOP_FIELDS[rig.loop]:
        rig[f"controller.{name}"]
    if rig.loop == "mit" and rig["controller.k_p"] == 0.0:
        yield (
            "controller.k_p = 0 in a mit loop, expected > 0 N·m/rad; frames of torques alone have no "
            "controller: map their torque as `command`, add k_d to rotor.reflected_damping"
        ), "controller.k_p"
    for name in LOOP_FIELDS["mit"] if rig.loop == "mit" else ():
        if (where := f"controller.{name}") in rig.free():
            yield f"{where} has a spread of {rig.spread(where):g}, expected none: frames say it", where


def check_two_torques(rig: Rig) -> None:
    """Raise RigError for a rig without a spring: it has one torque, not one on either side."""
    if rig.rigid_spring:
        raise RigError(f"rig {rig.name}: spring.rigid = True, expected a spring with a torque on either side")


def check_unfiltered(rig: Rig, channels: Collection[str], what: str) -> None:
    """Raise RigError where a channel has a known filter that something (what) cannot serve."""
    for at in (f"sensors.{n}.filter" for n in rig.filters() if n in channels):
        raise RigError(f"rig {rig.name}: {at}, expected none for {what}", at)
