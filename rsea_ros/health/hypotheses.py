"""Hypotheses of what changed, the looks at the joint's events, and the bank of observers that play them.

A look is a second of events in order, with those before it that let the filters settle. In it

    w(theta) = innovation over its standard deviation, white and of variance 1 for the right theta
    D_i = (w(theta + step_i) - w(theta)) / step_i,   A = D'D,   c = -D'w

c is the score and A Fisher's information of the changes: were the change d, log p(d)/p(0) = d c - d^2 A / 2.
Source: Basseville, Nikiforov, Detection of Abrupt Changes, 1993, section 8.2 (the local approach).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.observer.assemble import Noise
from rsea_ros.model.observer.log import COMMAND, FT, STATE, BatchObserver
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.records.record import FloatArray, IntArray
from rsea_ros.records.statistics import Z95

FILTER_SETTLING, LENGTH = 0.25, 1.0
"""s. Ten time constants of the disturbance's filter; long beside them, short beside a movement."""
FEWEST = 20
"""Measurements of a look that can be counts."""


class Look(NamedTuple):
    """Events by stamp: t (s, shape (n,)), kind (of observer/log.py), values (n, 2): position and motor
    torque, or ft, or command. counts: where the innovations count, shape (n,).
    """

    t: FloatArray
    kind: IntArray
    values: FloatArray
    counts: np.ndarray[tuple[int], np.dtype[np.bool_]]

    def travel(self) -> float:
        """Return how far the joint moved, rad."""
        q = self.values[self.kind == STATE, 0]
        q = q[np.isfinite(q)]
        return float(np.ptp(q)) if len(q) else 0.0


class Cutter:
    """Cuts looks out of the stream. every: s from the beginning of one look to that of the next."""

    def __init__(self, every: float) -> None:
        self.every = every
        self.clear()

    def clear(self) -> None:
        """Forget all events."""
        self._t, self._kind = np.empty(0), np.empty(0, dtype=np.int64)
        self._values = np.empty((0, 2))
        self._begin = -np.inf

    def take(
        self, t: FloatArray, kind: IntArray, values: FloatArray, *, closer: bool = False
    ) -> Iterator[Look]:
        """Add events, sorted and later than those before; yield complete looks.

        closer: one look follows the other without a pause.
        """
        self._t = np.concatenate([self._t, t])
        self._kind = np.concatenate([self._kind, kind])
        self._values = np.concatenate([self._values, values])
        while len(self._t):
            if not np.isfinite(self._begin):
                self._begin = float(self._t[0])
            end = self._begin + FILTER_SETTLING + LENGTH
            if self._t[-1] <= end:
                break
            look = self._cut(self._begin, end)
            self._begin += LENGTH if closer else max(LENGTH, self.every)
            if look is not None:
                yield look
        first = int(np.searchsorted(self._t, min(self._begin, self._t[-1] if len(self._t) else 0.0)))
        before = np.flatnonzero(self._kind[:first] == COMMAND)[-1:]  # the command in force stays
        keep = int(before[0]) if len(before) else first
        self._t, self._kind, self._values = self._t[keep:], self._kind[keep:], self._values[keep:]

    def _cut(self, begin: float, end: float) -> Look | None:
        first, last = np.searchsorted(self._t, [begin, end], side="right")
        before = np.flatnonzero(self._kind[:first] == COMMAND)[-1:]
        part = np.concatenate([before, np.arange(first, last)])
        t, kind = self._t[part], self._kind[part]
        counts = (t > begin + FILTER_SETTLING) & (kind != COMMAND)
        return Look(t, kind, self._values[part], counts) if counts.sum() >= FEWEST else None


FACTOR = "friction.factor"
GAINS = ("torque_constant_error.gain", "ft_gain_error.gain")
"""Calibrations, which no record of the joint alone can separate from its stiffness and inertia."""
GAIN_DOUBT = 0.01
"""Relative one-sigma doubt of the calibration of F/T sensor and torque constant, for which a model stands."""
EFFECT_DOUBT = 0.1
"""Relative one-sigma doubt of an effect's parameter in a model.yaml, which states none."""


@dataclass(frozen=True)
class ChangeHypothesis:
    """One parameter of the joint. All numbers in its unit.

    value: the model's. doubt: one sigma of it. least: smallest change beyond that doubt that is worth an
    alarm. step: change at which the sensitivity is taken. low, high: bounds of the value. grain: difference
    below which the data cannot show it, as a delay within a sample. relative: `apply` takes the new value
    over the old one. common: one sigma of the part that all looks share, as of a calibration.
    """

    code: str
    name: str
    unit: str
    value: float
    doubt: float
    least: float
    step: float
    low: float
    high: float
    apply: Callable[[Rig, float], Rig]
    grain: float = 0.0
    relative: bool = False
    common: float = 0.0

    @property
    def inner(self) -> float:
        """Largest change that the doubt in the model allows."""
        return Z95 * self.doubt

    @property
    def outer(self) -> float:
        """Smallest change that is to be alarmed."""
        return self.inner + self.least

    def within(self, change: float) -> float:
        """Return the nearest change that the bounds allow."""
        return min(max(change, self.low - self.value), self.high - self.value)

    def change(self, rig: Rig, change: float) -> Rig:
        """Return the rig with the parameter changed, within its bounds."""
        value = min(max(self.value + change, self.low), self.high)
        return self.apply(rig, value / self.value if self.relative else value)


def hypotheses_of(rig: Rig, period: float) -> tuple[ChangeHypothesis, ...]:
    """Return the possible changes of a joint. period: s, between measurements."""
    delay = _effect(rig, "command_delay", "delay", "RSEA_DELAY", 0.25, 0.5 * period, period)
    gain = _effect(rig, "torque_constant_error", "gain", "RSEA_TORQUE_CONSTANT", 0.0, 0.05, 0.05)
    hypotheses = [
        _field(rig, "rotor.reflected_damping", "RSEA_FRICTION", 0.25),
        _effect(rig, "coulomb_friction", "torque", "RSEA_FRICTION", 0.25, 0.5, 0.5),
        _friction(rig), replace(delay, grain=period), replace(gain, doubt=GAIN_DOUBT),
    ]  # fmt: skip
    if not rig.rigid_spring:
        hypotheses.append(_field(rig, "spring.stiffness", "RSEA_STIFFNESS", 0.05))
        if rig.ft_end == "spring_end":
            hypotheses.append(_effect(rig, "backlash", "gap", "RSEA_BACKLASH", 0.25, 1e-3, 2e-3))
    if "ft" in rig.sensors and not rig.rigid_spring:
        sigma = max(rig.sensors["ft"].noise, rig.sensors["ft"].quantum)
        gain = _effect(rig, "ft_gain_error", "gain", "RSEA_FT_GAIN", 0.0, 0.03, 0.05)
        hypotheses.append(replace(gain, doubt=GAIN_DOUBT))
        hypotheses.append(_effect(rig, "ft_bias", "bias", "RSEA_FT_BIAS", 0.0, 10.0 * sigma, 10.0 * sigma))
    return tuple(h for h in hypotheses if h is not None)


def nuisances_of(rig: Rig) -> tuple[ChangeHypothesis, ...]:
    """Return parameters without a code that may be slightly wrong in the model: inertia, spring damping."""
    names = ["rotor.reflected_inertia", *([] if rig.rigid_spring else ["spring.damping"])]
    hypotheses = (_field(rig, name, "", 0.1) for name in names)
    return tuple(h for h in hypotheses if h is not None)


def _friction(rig: Rig) -> ChangeHypothesis:
    """Return the hypothesis that viscous and Coulomb friction grow together, as in a cold or a worn gear."""
    name = "rotor.reflected_damping"
    dry = _effect(rig, "coulomb_friction", "torque", "RSEA_FRICTION", 0.0, 0.0, 0.0)

    def scale(rig: Rig, factor: float) -> Rig:
        torque = next((e.parameters["torque"] for e in rig.effects if e.name == "coulomb_friction"), 0.0)
        return dry.apply(rig.with_values({name: factor * rig[name]}), factor * torque)

    return ChangeHypothesis(
        "RSEA_FRICTION", FACTOR, "1", 1.0, EFFECT_DOUBT, 0.2, 0.2, 0.05, 20.0, scale,
        relative=True,
    )  # fmt: skip


def _field(rig: Rig, name: str, code: str, part: float) -> ChangeHypothesis | None:
    """Return the hypothesis of a rig's value; part of it that is worth an alarm."""
    value = rig[name]
    if not value > 0.0 or math.isinf(value):
        return None
    return ChangeHypothesis(
        code, name, rig.unit(name), value, _doubt(rig, name), part * value, part * value, 0.02 * value,
        50.0 * value, lambda rig, v: rig.with_values({name: v}),
    )  # fmt: skip


def _doubt(rig: Rig, name: str) -> float:
    quantity = rig.quantities[name]
    if quantity.ci95 is not None:
        return (quantity.ci95[1] - quantity.ci95[0]) / (2.0 * Z95)
    return 0.0 if name in rig.known else 0.5 * quantity.spread * quantity.value


def _effect(
    rig: Rig, name: str, parameter: str, code: str, part: float, least: float, step: float
) -> ChangeHypothesis:
    """Return the hypothesis of an effect's parameter. part: of the model's value that is worth an alarm."""
    effect = effect_named(name)
    (which,) = (p for p in effect.parameters if p.name == parameter)
    value = next((e.parameters[parameter] for e in rig.effects if e.name == name), which.null)
    known = abs(value - which.null)
    return ChangeHypothesis(
        code, f"{name}.{parameter}", which.unit, value, EFFECT_DOUBT * known, max(least, part * known),
        max(step, part * known), which.low, which.high, lambda rig, v: _set(rig, name, parameter, v),
    )  # fmt: skip


def _set(rig: Rig, name: str, parameter: str, value: float) -> Rig:
    """Return the rig with a parameter of an effect, which is added where the rig does not have it."""
    others = [e for e in rig.effects if e.name != name]
    mine = [e for e in rig.effects if e.name == name] or [EffectSetting(name, {})]
    setting = replace(mine[0], parameters={**mine[0].parameters, parameter: value})
    return rig.with_effects(*others, setting)


CHANNELS = ("position", "ft", "motor_torque")
HEAVY = 8.0
"""Standard deviations beyond which an innovation counts for less: an outlier counts no more than the rest."""


class LookEvidence(NamedTuple):
    """Of one look by channel: c (3, p), A (3, p, p), sum of squares and number of innovations, shape (3,)."""

    score: FloatArray
    information: FloatArray
    squares: FloatArray
    counts: FloatArray

    def scale_sums(self, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c (p,) and A (p, p) of all channels. scale: standard deviation of the innovations, (3,)."""
        weights = 1.0 / scale**2
        return weights @ self.score, np.tensordot(weights, self.information, 1)


class Bank:
    """The observers of a rig. hold: how long a command stays in force, s."""

    def __init__(self, rig: Rig, noise: Noise, hypotheses: Sequence[ChangeHypothesis], hold: float) -> None:
        self._steps = np.array([[h.step] for h in hypotheses])
        rigs = (rig, *(h.change(rig, h.step) for h in hypotheses))
        self._observers = [BatchObserver(each, noise, hold=hold) for each in rigs]

    def evidence(self, look: Look) -> LookEvidence:
        """Return the evidence of a look."""
        by_channel = [whiten(observer, look) for observer in self._observers]
        p, n = len(self._steps), len(CHANNELS)
        evidence = LookEvidence(np.zeros((n, p)), np.zeros((n, p, p)), np.zeros(n), np.zeros(n))
        for channel in range(n):
            w = np.array([each[channel] for each in by_channel])
            w = w[:, np.isfinite(w).all(axis=0)]
            weight = np.minimum(1.0, HEAVY / np.maximum(np.abs(w[0]), 1e-9))
            d = (w[1:] - w[0]) / self._steps
            evidence.score[channel] = -(d * weight) @ w[0]
            evidence.information[channel] = (d * weight) @ d.T
            evidence.squares[channel], evidence.counts[channel] = float(w[0] @ (weight * w[0])), w.shape[1]
        return evidence


def whiten(observer: BatchObserver, look: Look) -> tuple[FloatArray, ...]:
    """Return the innovations of a look by channel over their standard deviations; nan where missing."""
    w = observer.innovations(look.t, look.kind, look.values)
    state, ft = look.counts & (look.kind == STATE), look.counts & (look.kind == FT)
    return w[state, 0], w[ft, 0], w[state, 1]
