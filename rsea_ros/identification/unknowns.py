"""The unknowns of a fit: values of the rig, parameters of effects, and the clocks of the sensors."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect, Parameter
from rsea_ros.model.rig import FIELDS, LEAST_SIZE, EffectSetting, Quantity, Rig, field_of
from rsea_ros.records.record import FloatArray

TURN = 2.0 * math.pi
CLOCK, CLOCK_RATE = "clock", "clock_rate"
CLOCK_REACH = 3.0
"""Sigmas that a fit may move a clock."""
LOOP_CLOCK = "clock.motor_torque"
RATE_DOUBT, FASTEST = 50.0, 500.0
"""ppm, one sigma and bound. How much faster the clock of a sensor may run: cheap crystals differ by 100."""


@dataclass(frozen=True)
class Clocks:
    """By channel how much later than stamped it is read.

    offset: s, at the start of a record. rate: ppm of the time since then.
    """

    offset: Mapping[str, float]
    rate: Mapping[str, float]

    def later(self, channel: str, since: FloatArray | float) -> FloatArray | float:
        """Return how much later than stamped a channel is read at times since the start of the record, s."""
        return self.offset.get(channel, 0.0) + 1e-6 * self.rate.get(channel, 0.0) * since

    def move(self, delay: float, channels: Iterable[str]) -> Clocks:
        """Return the clocks with some channels read `delay` s later still."""
        return Clocks({**self.offset, **{n: self.offset.get(n, 0.0) + delay for n in channels}}, self.rate)

    @property
    def are_right(self) -> bool:
        """Whether every channel is read at its stamps."""
        return not any(self.offset.values()) and not any(self.rate.values())


SMOOTH, JUMPING = 1e-5, 0.1
"""Of an unknown's scale, over which derivatives are taken: exact enough for the end of a bent valley, and so
wide that a law that jumps does so at some samples on either side (decision 312)."""
WELL_KNOWN = 0.3
"""Relative prior spread up to which a fit works on the logarithm of a value."""


@dataclass(frozen=True)
class Unknown:
    """One number that a fit may move.

    name: `rotor.reflected_inertia`, `coulomb_friction.torque`, `clock.ft`, `spring.damping@cold` of a record.
    low, high: bounds, SI.
    logarithmic: the fit works on its logarithm. doubt: one sigma of the prior around `start`, in the
    coordinate that the fit works in; inf for none. scale: a step of that coordinate that matters.
    inverse: the fit works on -1 / value, for what is infinite as a rule and has no slope there.
    difference: of scale, over which its derivatives are taken.
    """

    name: str
    start: float
    unit: str
    low: float
    high: float
    logarithmic: bool
    doubt: float
    scale: float
    inverse: bool = False
    difference: float = SMOOTH

    @property
    def spread(self) -> float:
        """Return the prior's one sigma over the value that it is around; absolute where that is 0."""
        return self.doubt if self.logarithmic else self.doubt / (abs(self.start) or 1.0)

    @cached_property
    def is_clock(self) -> bool:
        """Whether it is the clock error of a sensor, or its rate."""
        return self.name.split(".")[0] in (CLOCK, CLOCK_RATE)

    @cached_property
    def is_rate(self) -> bool:
        """Whether it is the rate of a sensor's clock."""
        return self.name.startswith(CLOCK_RATE + ".")

    @cached_property
    def is_cyclic(self) -> bool:
        """Whether a whole turn more is the same value: an angle that only its sine enters by."""
        return field_of(self.name).endswith(".gravity_angle")

    def sigmas(self, coordinate: float) -> float:
        """Return how many sigmas of its prior a value lies from its start.

        A wide doubt is one of the order of magnitude: with 100 % twice the start is one sigma above it, four
        times two. Below the start, where the value may be next to nothing, sigmas are even.
        """
        coordinate = self.outer(coordinate) if self.is_cyclic else coordinate
        off = (coordinate - self.inner(self.start)) / self.doubt
        if off <= 0.0 or self.logarithmic or self.start <= 0.0 or not math.isfinite(self.doubt):
            return abs(off)
        return math.log(self.outer(coordinate) / self.start) / math.log1p(self.doubt / self.start)

    @property
    def reach(self) -> float:
        """Return how far from its start it can lie without data: its doubt, else the bounds."""
        if math.isfinite(self.doubt):
            return self.doubt
        bounded = self.low > 0.0 or not self.logarithmic
        wide = self.inner(self.high) - self.inner(self.low) if bounded else math.inf
        return wide if math.isfinite(wide) else 1e6 * self.scale

    def at_bound(self, coordinate: float) -> bool:
        """Return whether the fit ended at a bound that is not where it vanishes."""
        bounds = (b for b in (self.low, self.high) if b > 0.0 or not self.logarithmic)
        ends = [self.inner(b) for b in bounds if math.isfinite(b)]
        return any(abs(coordinate - end) < 1e-6 * self.scale for end in ends if end != self.inner(self.start))

    def is_near_bound(self, coordinate: float, near: float) -> bool:
        """Return whether its value lies within a share `near` of its span of a bound."""
        margin = near * (self.high - self.low)
        return not self.low + margin < self.outer(coordinate) < self.high - margin

    def inner(self, value: float) -> float:
        """Return the coordinate that the fit works in."""
        if self.inverse:
            return -1.0 / value
        return math.log(value) if self.logarithmic else value

    def outer(self, coordinate: float) -> float:
        """Return the value in SI, inside the bounds; 0 where 0 is allowed and only rounding is left."""
        value = math.exp(min(coordinate, 700.0)) if self.logarithmic else coordinate
        if self.inverse:
            value = -1.0 / coordinate if coordinate < 0.0 else math.inf
        value = math.remainder(value, TURN) if self.is_cyclic else min(max(value, self.low), self.high)
        return 0.0 if abs(value) < LEAST_SIZE and self.low <= 0.0 else value


def unknowns_of_rig(rig: Rig) -> tuple[Unknown, ...]:
    """Return the values of the rig that a fit may move, of single records too, with spreads as priors."""
    shared = {n: rig.quantities[n] for n in rig.free()}
    own = {n: q for n, q in rig.of_records().items() if q.spread > 0.0 and field_of(n) not in rig.known}
    return tuple(_rig_unknown(name, quantity) for name, quantity in {**shared, **own}.items())


def _rig_unknown(name: str, quantity: Quantity) -> Unknown:
    """Return a value of the rig as an unknown: on its logarithm where its prior keeps it away from 0.

    A value that may well be near zero (a damping) moves on its own scale: its logarithm would never return.
    """
    value, spread, field = quantity.value, quantity.spread, FIELDS[field_of(name)]
    if value > 0.0 and spread <= WELL_KNOWN:
        return Unknown(name, value, field.unit, value * 1e-4, value * 1e4, True, spread, 1.0)
    doubt = spread * value if value > 0.0 else math.inf
    low = field.low if field.low_allowed else 1e-4 * value
    return Unknown(name, value, field.unit, low, math.inf, False, doubt, value or 1.0)


def unknowns_of_effect(
    effect: Effect, start: Mapping[str, float], known: Collection[str] = ()
) -> tuple[Unknown, ...]:
    """Return the parameters of an effect from a start, each with its prior; not those in `known`."""
    complete = effect.complete(start)
    return tuple(
        _effect_unknown(effect, p, complete[p.name])
        for p in effect.parameters
        if f"{effect.name}.{p.name}" not in known
    )


def _effect_unknown(effect: Effect, p: Parameter, start: float) -> Unknown:
    start, name = min(max(start, p.low), p.high), f"{effect.name}.{p.name}"
    if math.isinf(p.null) and p.typical == p.high:
        scale = 1.0 / min(p.starts)
        return Unknown(name, start, p.unit, p.low, p.high, False, p.spread, scale, inverse=True)
    scale = 1.0 if p.logarithmic else abs(p.typical) or 1.0
    difference = JUMPING if p.jumps else SMOOTH
    return Unknown(name, start, p.unit, p.low, p.high, p.logarithmic, p.spread, scale, difference=difference)


def idle(effect: Effect, rig: Rig) -> frozenset[str]:
    """Return the names of the parameters of an effect that do nothing on a rig."""
    return frozenset(f"{effect.name}.{p}" for p in (effect.idle(rig) if effect.idle else ()))


def clocks(channels: Iterable[str], rig: Rig) -> tuple[Unknown, ...]:
    """Return the clock errors of sensors, s: measured later than stamped when positive.

    They count from a motor's torque that follows the command. A loop makes its own: a log may hold that of
    its own frame or of the one before.
    """
    tick = rig["controller.sample_time"] if rig.loop is not None else 0.0
    doubts = {c: tick if c == "motor_torque" else rig.clock_doubt(c) for c in channels}
    doubts = {c: d for c, d in doubts.items() if d > 0.0}
    return tuple(
        Unknown(f"{CLOCK}.{c}", 0.0, "s", -CLOCK_REACH * d, CLOCK_REACH * d, False, d, d)
        for c, d in doubts.items()
    )


def clock_rates(channels: Iterable[str]) -> tuple[Unknown, ...]:
    """Return the rates of the sensors' clocks, ppm: read later and later than stamped when positive."""
    return tuple(
        Unknown(f"{CLOCK_RATE}.{c}", 0.0, "ppm", -FASTEST, FASTEST, False, RATE_DOUBT, RATE_DOUBT)
        for c in channels
        if c != "motor_torque"
    )


def apply(rig: Rig, unknowns: Sequence[Unknown], theta: FloatArray) -> tuple[Rig, Clocks]:
    """Return the rig with the values of theta, effects included, and the clocks of its sensors."""
    values = {u.name: u.outer(t) for u, t in zip(unknowns, theta.tolist(), strict=True)}
    of_rig = {n: v for n, v in values.items() if field_of(n) in FIELDS}
    offset, rate = (
        {u.name.split(".")[1]: values[u.name] for u in unknowns if u.is_clock and u.is_rate == of_rate}
        for of_rate in (False, True)
    )
    return rig.moved(of_rig, tuple(_move(e, values) for e in rig.effects)), Clocks(offset, rate)


def _move(setting: EffectSetting, values: Mapping[str, float]) -> EffectSetting:
    names = (u for u in values if u.startswith(f"{setting.name}."))
    return replace(setting, parameters={**setting.parameters, **{n.split(".")[1]: values[n] for n in names}})


def bounds_of(unknowns: Sequence[Unknown]) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of a fit in its coordinates; a logarithm has one far below every value."""
    low = [u.inner(max(u.low, 1e-300) if u.logarithmic else u.low) for u in unknowns]
    return np.array(low), np.array([u.inner(u.high) for u in unknowns])


def start_vector(unknowns: Sequence[Unknown]) -> FloatArray:
    """Return the start of the fit in its coordinates."""
    return np.array([u.inner(u.start) for u in unknowns])


def vector_of(unknowns: Sequence[Unknown], rig: Rig) -> FloatArray:
    """Return the coordinates of a rig's values; for values that it does not state, the fit's start."""
    values = {**rig.values(), **{name: quantity.value for name, quantity in rig.of_records().items()}}
    return np.array([u.inner(values.get(u.name, u.start)) for u in unknowns])


def theta_with(
    unknowns: Sequence[Unknown], theta: FloatArray, values: Mapping[str, float]
) -> FloatArray:
    """Return theta with other values (SI) of the unknowns that are named."""
    coordinates = zip(unknowns, theta, strict=True)
    return np.array([u.inner(values[u.name]) if u.name in values else float(t) for u, t in coordinates])


def with_effect(rig: Rig, name: str, parameters: Mapping[str, float]) -> Rig:
    """Return the rig with one more effect acting."""
    effect_named(name).vector(parameters)
    return rig.with_effects(*rig.effects, EffectSetting(name, parameters))
