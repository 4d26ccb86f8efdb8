"""What the controller makes of the simulated actuator: a table of trials, each with what is asked of it.

All run one sample at a time on the simulated bench with the noise of its sensors, one sample of delay in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.controller import Limits, TorqueController
from rsea_ros.control.harness import closed_loop
from rsea_ros.control.large_signal import largest
from rsea_ros.control.loads import LOCKED
from rsea_ros.control.prediction import AHEAD
from rsea_ros.control.synthesis import Design
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.signals import ComplexArray, FloatArray

HZ, AMPLITUDE = 5.0, 10.0
SECONDS, SETTLE = 3.0, 1.0
ARCMIN = math.pi / 180.0 / 60.0
UNLIMITED = Limits(torque=1e6, slew=1e12, ramp=0.0)
EFFECTS = (
    EffectSetting("coulomb_friction", {"torque": 3.0}),
    EffectSetting(
        "stribeck_friction", {"coulomb_torque": 1.5, "stribeck_torque": 2.0, "stribeck_velocity": 0.05}
    ),
    EffectSetting("torque_ripple", {"amplitude": 3.0, "cycles_per_revolution": 4.0, "phase": 0.7}),
    EffectSetting("backlash", {"gap": 5.0 * ARCMIN}),
)
RIPPLE_HZ = 1.0
"""Ripple is tried at a slower sine: at 5 Hz it passes faster than samples come."""


@dataclass(frozen=True)
class Trial:
    """what was tried, the value, its unit, what is asked (None: nothing), and whether more is better."""

    what: str
    value: float
    unit: str
    asked: float | None = None
    least: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the value is as asked; None where nothing is, or where the rig gives no value."""
        if self.asked is None or math.isnan(self.value):
            return None
        return self.value >= self.asked if self.least else self.value <= self.asked


@dataclass(frozen=True)
class Responses:
    """T_d / desired at hz, shape (n,): clamped, free, and clamped with the desired torque known ahead."""

    hz: FloatArray
    locked: ComplexArray
    free: ComplexArray
    known: ComplexArray


@dataclass(frozen=True)
class Compensated:
    """An effect, the error of a sine (relative, RMS) with a model that lacks it and one that has it."""

    effect: EffectSetting
    hz: float
    without: float
    with_model: float

    @property
    def gain(self) -> float:
        """1 - error with the model / error without it."""
        return 1.0 - self.with_model / self.without if self.without > 0.0 else math.nan


def trials(rig: Rig, free: Rig, design: Design, resonance: float, seen: Responses) -> Iterator[Trial]:
    """Yield the trials of a clamped rig and the same with free ends. resonance: of the open loop, Hz."""
    at = design.margins[LOCKED]
    others = [m for name, m in design.margins.items() if name != LOCKED]
    band = 3.0 * resonance
    yield Trial("torque bandwidth, -3 dB, locked", bandwidth(seen.hz, seen.locked), "Hz", band, least=True)
    yield Trial("torque bandwidth, -3 dB, free", bandwidth(seen.hz, seen.free), "Hz", band, least=True)
    both = bandwidth(seen.hz, seen.locked, both_ways=True)
    yield Trial("T_d / desired within ±3 dB, locked", both, "Hz", band, least=True)
    known = bandwidth(seen.hz, seen.known, both_ways=True)
    yield Trial("the same, desired torque known 2 samples ahead", known, "Hz", band, least=True)
    yield Trial("crossover of the feedback loop, locked", at.crossover, "Hz", band, least=True)
    yield Trial("phase margin, locked", at.phase, "deg", 45.0, least=True)
    yield Trial("least phase margin, any other load", min(m.phase for m in others), "deg", 35.0, least=True)
    yield Trial("least gain margin", min(m.gain for m in design.margins.values()), "dB", 6.0, least=True)
    yield Trial(
        "least delay margin", min(m.delay for m in design.margins.values()), "samples", 1.0, least=True
    )
    yield Trial("5 Hz, 10 N m, locked", 100.0 * sine(rig, rig, design), "%", 2.0)
    yield Trial("5 Hz, 10 N m, free, no limit", 100.0 * sine(free, free, design, limits=UNLIMITED), "%", 4.0)
    most = largest(free, HZ, Limits().torque, math.inf)
    small = min(AMPLITUDE, 0.9 * most)
    yield Trial(
        f"5 Hz, {small:.1f} N m, free, within 68 N m", 100.0 * sine(free, free, design, small), "%", 4.0
    )
    rough = rig.with_effects(EFFECTS[0])
    yield Trial("3 N m friction, not in the model", 100.0 * sine(rough, rig, design), "%", 6.0)
    yield Trial("3 N m friction, in the model", 100.0 * sine(rough, rough, design), "%", 2.5)
    yield Trial(
        "held with 5 arcmin of backlash: torque RMS over that without", restlessness(rig, design), "1", 1.1
    )


def compensations(rig: Rig, design: Design) -> Iterator[Compensated]:
    """Yield what each compensated effect costs without and with its compensation."""
    for effect in EFFECTS:
        hz = RIPPLE_HZ if effect.name == "torque_ripple" else HZ
        true = rig.with_effects(effect)
        errors = (sine(true, rig, design, hz=hz), sine(true, true, design, hz=hz))
        yield Compensated(effect, hz, *errors)


def sine(
    true: Rig,
    model: Rig,
    design: Design,
    amplitude: float = AMPLITUDE,
    hz: float = HZ,
    limits: Limits | None = None,
) -> float:
    """Return the RMS error of a sine (N m, Hz), over its own RMS, after a second."""
    t = np.arange(round(SECONDS * design.rate)) / design.rate
    rise = np.minimum(1.0, 4.0 * t) ** 2
    controller = TorqueController(model, design.rate, design.gains, limits=limits)
    wanted = amplitude * rise * np.sin(2.0 * np.pi * hz * t)
    return closed_loop(true, design.rate, controller, wanted).error(SETTLE)


def restlessness(rig: Rig, design: Design, gap: float = 5.0 * ARCMIN) -> float:
    """Return the torque's RMS about its mean with backlash, over that without, worst of a few torques held.

    Each is held after a sine has shaken the gap. 1 is the noise of the sensor alone; NaN for a rig whose F/T
    sensor has no noise stated, beside which there is nothing to compare with.
    """
    if "ft" not in rig.sensors or rig.sensors["ft"].noise <= 0.0:
        return math.nan
    worn = rig.with_effects(EffectSetting("backlash", {"gap": gap}))
    ratios = []
    for torque in (0.0, 0.3, 2.0):
        noise, with_gap = (_held(true, rig, design, torque) for true in (rig, worn))
        ratios.append(with_gap / noise)
    return max(ratios)


def _held(true: Rig, model: Rig, design: Design, torque: float) -> float:
    t = np.arange(round(SECONDS * design.rate)) / design.rate
    wanted = np.where(t < SETTLE, AMPLITUDE * np.sin(2.0 * np.pi * HZ * t), torque)
    controller = TorqueController(model, design.rate, design.gains, compensate=())
    ft = closed_loop(true, design.rate, controller, wanted).ft[t >= SETTLE + 1.0]
    return float(np.std(ft))


def responses_of(rig: Rig, free: Rig, design: Design) -> Responses:
    """Return the responses of a clamped rig and the same with free ends."""
    hz, locked = response(rig, design)
    return Responses(hz, locked, response(free, design)[1], response(rig, design, preview=True)[1])


def response(
    rig: Rig, design: Design, *, preview: bool = False, seconds: float = 4.0
) -> tuple[FloatArray, ComplexArray]:
    """Return hz and T_d / desired, from the answer of the noise-free simulation to a single sample.

    preview: desired torques are known as far ahead as the controller needs, instead of predicted.
    """
    n = round(seconds * design.rate)
    wanted = np.zeros(n)
    wanted[AHEAD] = 1.0
    quiet = rig.with_effects()
    controller = TorqueController(quiet, design.rate, design.gains, limits=UNLIMITED, preview=preview)
    ahead = AHEAD if preview else 0
    ft = closed_loop(quiet, design.rate, controller, wanted, noise=False, ahead=ahead).ft
    hz = np.asarray(np.fft.rfftfreq(n, 1.0 / design.rate)[1:])
    return hz, np.fft.rfft(ft)[1:] / np.fft.rfft(wanted)[1:]


def bandwidth(hz: FloatArray, answer: ComplexArray, *, both_ways: bool = False) -> float:
    """Return where T_d / desired leaves -3 dB, Hz; the highest frequency where it never does.

    both_ways: where it leaves ±3 dB.
    """
    decibel = 20.0 * np.log10(np.abs(answer))
    out = ((decibel < -3.0) | (both_ways & (decibel > 3.0))) & (hz > 1.0)
    return float(hz[np.argmax(out)]) if out.any() else float(hz[-1])
