"""The study of a controlled actuator: design at each rate, trials, impedance, limits.

Trials run one sample at a time on the simulated bench with the noise of its sensors, one sample of delay in
it: the worst case beside the nominal. The controller assumes a rig with both ends clamped, whatever load the
bench has.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rsea_ros.control import robustness as robust, uncertainty
from rsea_ros.control.controller import ControllerSettings, TorqueController, TorqueLimits
from rsea_ros.control.following import Following, Step, closed_loop, fall, follow, step_response
from rsea_ros.control.link import LinkShare
from rsea_ros.control.margins import OutputImpedance, impedance
from rsea_ros.control.synthesis import ControllerDesign, DesignLimits, design
from rsea_ros.control.uncertainty import LOCKED, BenchVariant, Uncertainty, load_range, variant_rig
from rsea_ros.errors import ParameterError
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import EffectSetting, Rig, motor_torque

HZ, AMPLITUDE = 5.0, 10.0


class Span(NamedTuple):
    """Duration of a trial and the time from which it counts, s."""

    seconds: float
    counted_from: float


BRIEF, LEARNED = Span(3.0, 1.0), Span(4.0, 3.0)
"""A trial with the stated load; one with another load, once that is learned."""
ARCMIN = math.pi / 180.0 / 60.0
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
class TrialResult:
    """what was tried, the value, its unit, what is asked (None: nothing), and whether more is better.

    worst: over the set, nan where it was not looked at; allowed: what is asked of that.
    """

    what: str
    value: float
    unit: str
    asked: float | None = None
    least: bool = False
    worst: float = math.nan
    allowed: float | None = None

    @property
    def met(self) -> bool | None:
        """Whether both values are as asked; None where nothing is, or where the rig gives no value."""
        pairs = ((self.value, self.asked), (self.worst, self.allowed))
        kept = [(v, limit) for v, limit in pairs if limit is not None and not math.isnan(v)]
        if not kept:
            return None
        return all(value >= limit if self.least else value <= limit for value, limit in kept)


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


def trials(
    rig: Rig,
    loads: Mapping[str, Rig],
    design: ControllerDesign,
    swept: robust.Robustness,
    near: Following,
    far: Following,
    apart: robust.Spread,
    stiffest: float,
) -> Iterator[TrialResult]:
    """Yield the trials of a clamped rig, its loads and the whole set.

    near, far: how torque follows on the rig, and on the hardest bench of the set. apart: what the set makes
    of the first. stiffest: largest impedance of the set over that of the spring.
    """
    nominal, worst, demand = design.margins, swept.margins, DesignLimits()
    each = list(nominal.values())
    yield TrialResult(
        "benches of the set that are unstable", 0.0, "1", None, worst=swept.unstable, allowed=0.0
    )
    largest_peak = max(m.sensitivity for m in each)
    yield TrialResult("largest sensitivity", largest_peak, "1", demand.sensitivity, worst=swept.sensitivity,
                      allowed=1.05 * demand.robust)  # fmt: skip
    yield TrialResult("phase margin", min(m.phase for m in each), "deg", 29.0, True, worst.phase)
    yield TrialResult("gain margin", min(m.gain for m in each), "dB", 6.0, True, worst.gain)
    yield TrialResult("delay margin", min(m.delay for m in each), "samples", 1.0, True, worst.delay)
    yield TrialResult("crossover", nominal[LOCKED].crossover, "Hz", worst=worst.crossover)
    yield TrialResult("output impedance, largest over the spring's", design.impedance, "1",
                      demand.impedance, worst=stiffest)  # fmt: skip
    yield from _sine_results(rig, loads, design)
    yield from _bandwidth(near, far, apart)
    u = design.uncertainty
    hardest = step_response(hard(loads, u), rig, design, late=u.samples)
    yield from _step_results(step_response(rig, rig, design), hardest)
    rough = rig.with_effects(EFFECTS[0])
    yield TrialResult("3 N·m friction, not in the model", 100.0 * sine(rough, rig, design), "%", 6.0)
    yield TrialResult("3 N·m friction, in the model", 100.0 * sine(rough, rough, design), "%", 2.5)
    yield TrialResult(
        "held with 5 arcmin of backlash: torque RMS over that without", restlessness(rig, design), "1", 1.1
    )


def _sine_results(rig: Rig, loads: Mapping[str, Rig], design: ControllerDesign) -> Iterator[TrialResult]:
    near = list(loads)[1:4]
    errors = {case: 100.0 * tracking_error(rig, loads, case, design) for name in loads
        for case in lagging_corners(name, design.uncertainty)}
    yield TrialResult(
        "5 Hz, 10 N·m, locked", 100.0 * sine(rig, rig, design), "%", 2.0,
        worst=max(errors.values()), allowed=8.0,
    )  # fmt: skip
    for name in near:
        error, amplitude = (
            100.0 * tracking_error(rig, loads, BenchVariant(name), design),
            amplitude_of(loads[name]),
        )
        worst = max(error, *(errors[case] for case in lagging_corners(name, design.uncertainty)))
        yield TrialResult(f"5 Hz, {amplitude:.1f} N·m, {name}, load unknown", error, "%", 5.0,
                          worst=worst, allowed=5.0)  # fmt: skip


def _bandwidth(near: Following, far: Following, apart: robust.Spread) -> Iterator[TrialResult]:
    least, most = (near.gain_at(apart.hz) + edge for edge in apart.gain)
    yield TrialResult("torque bandwidth, -3 dB", near.bandwidth, "Hz", 19.1, True,
                min(far.bandwidth, fall(apart.hz, least)))  # fmt: skip
    yield TrialResult("T_d / desired, largest", near.peak, "dB", 3.0, worst=max(far.peak, float(most.max())))
    at = min(near.bandwidth, float(near.hz[-1]))
    yield TrialResult(
        "motor torque per N·m at that bandwidth", near.motor_at(at), "1", worst=far.motor_at(at)
    )
    yield TrialResult("motor torque per N·m at 20 Hz", near.motor_at(20.0), "1", worst=far.motor_at(20.0))


def _step_results(near: Step, far: Step) -> Iterator[TrialResult]:
    yield TrialResult("step of 5 N·m: 10 to 90 %", 1e3 * near.rise, "ms", worst=1e3 * far.rise)
    yield TrialResult("its overshoot", 100.0 * near.overshoot, "%", worst=100.0 * far.overshoot)
    yield TrialResult("within 5 % after", 1e3 * near.settling, "ms", worst=1e3 * far.settling)


def lagging_corners(name: str, u: Uncertainty) -> list[BenchVariant]:
    """Return the corners of a load with all of the lag and the mode, K_s and b_m both high or both low."""
    return [
        BenchVariant(name, 1.0 + k * u.stiffness, 1.0 + k * u.damping, u.samples, u.delay, u.mode,
                     1.0 - k * u.inertia)
        for k in (1, -1)
    ]  # fmt: skip


def hard(loads: Mapping[str, Rig], u: Uncertainty) -> Rig:
    """Return the locked bench that is stiffer, lighter, drags less, lags, and has the mode."""
    stiff = BenchVariant(LOCKED, 1.0 + u.stiffness, 1.0 - u.damping, 0, u.delay, u.mode, 1.0 - u.inertia)
    return disturbed_rig(loads, stiff)


def disturbed_rig(loads: Mapping[str, Rig], case: BenchVariant) -> Rig:
    """Return the bench of a case as a rig with effects; samples that are late are for `closed_loop`."""
    effects = []
    if case.delay:
        effects.append(EffectSetting("command_delay", {"delay": case.delay}))
    if case.mode:
        shape = dict(zip(("frequency", "damping_ratio", "participation"), case.mode, strict=True))
        effects.append(EffectSetting("structural_resonance", shape))
    return variant_rig(loads[case.load], case).with_effects(*effects)


def amplitude_of(load: Rig) -> float:
    """Return the sine, N m, that a load lets its motor make at 5 Hz, a fifth of it to spare."""
    return min(AMPLITUDE, 0.8 * robust.largest(load.with_effects(), HZ, motor_torque(load)[0], math.inf))


def tracking_error(rig: Rig, loads: Mapping[str, Rig], case: BenchVariant, design: ControllerDesign) -> float:
    """Return the error of the sine on a bench of the set, once it has been learned."""
    true, amplitude = disturbed_rig(loads, case), amplitude_of(variant_rig(loads[case.load], case))
    return sine(true, uncertainty.lock(rig), design, amplitude, span=LEARNED, late=case.samples)


def compensations(rig: Rig, design: ControllerDesign) -> Iterator[Compensated]:
    """Yield what each compensated effect costs without and with its compensation."""
    for effect in EFFECTS:
        hz = RIPPLE_HZ if effect.name == "torque_ripple" else HZ
        true = rig.with_effects(effect)
        errors = (sine(true, rig, design, hz=hz), sine(true, true, design, hz=hz))
        yield Compensated(effect, hz, *errors)


def sine(
    true: Rig,
    model: Rig,
    design: ControllerDesign,
    amplitude: float = AMPLITUDE,
    hz: float = HZ,
    limits: TorqueLimits | None = None,
    *,
    span: Span = BRIEF,
    late: int = 0,
    link: LinkShare | None = None,
) -> float:
    """Return the RMS error of a sine (N m, Hz), over its own RMS, as it counts."""
    t = np.arange(round(span.seconds * design.rate)) / design.rate
    rise = np.minimum(1.0, 4.0 * t) ** 2
    controller = TorqueController(model, design.rate, design.gains, limits=limits, link=link)
    wanted = amplitude * rise * np.sin(2.0 * np.pi * hz * t)
    return closed_loop(true, design.rate, controller, wanted, late=late).error(span.counted_from)


def restlessness(rig: Rig, design: ControllerDesign) -> float:
    """Return the torque's RMS about its mean with backlash, over that without, worst of a few torques held.

    Each is held after a sine has shaken the gap. 1 is the noise of the sensor alone; NaN for a rig whose F/T
    sensor has no noise stated, beside which there is nothing to compare with.
    """
    if "ft" not in rig.sensors or rig.sensors["ft"].noise <= 0.0:
        return math.nan
    worn = rig.with_effects(EffectSetting("backlash", {"gap": 5.0 * ARCMIN}))
    ratios = []
    for torque in (0.0, 2.0):
        noise, with_gap = (_torque_scatter(true, rig, design, torque) for true in (rig, worn))
        ratios.append(with_gap / noise)
    return max(ratios)


def _torque_scatter(true: Rig, model: Rig, design: ControllerDesign, torque: float) -> float:
    """Return the standard deviation of ft while a controller holds a torque, N m."""
    t = np.arange(round(LEARNED.seconds * design.rate)) / design.rate
    wanted = np.where(t < BRIEF.counted_from, AMPLITUDE * np.sin(2.0 * np.pi * HZ * t), torque)
    settings = ControllerSettings(compensate=())
    controller = TorqueController(model, design.rate, design.gains, settings=settings)
    ft = closed_loop(true, design.rate, controller, wanted).ft[t >= LEARNED.counted_from]
    return float(np.std(ft))


AMPLITUDES = (10.0, 20.0, 40.0)


@dataclass(frozen=True)
class MotorLimits:
    """The motor's limits at the gear output: N m, rad/s (inf: not stated), and their source."""

    name: str
    torque: float
    speed: float
    source: str


@dataclass(frozen=True)
class AtRate:
    """One rate: design, the set swept, trials, gain of each compensation, impedance; T_d / desired of the
    clamped bench and of the free one, and what the set makes of each and of the impedance."""

    design: ControllerDesign
    swept: robust.Robustness
    trials: tuple[TrialResult, ...]
    compensations: tuple[Compensated, ...]
    locked: Following
    free: Following
    locked_spread: robust.Spread
    free_spread: robust.Spread
    impedance: OutputImpedance
    softness: robust.Softness


@dataclass(frozen=True)
class Study:
    """rig: both ends clamped; free: the same actuator with the lightest load.
    resonance: of the open loop, Hz.
    reaches: by motor, for the clamped and for the free rig, at each of AMPLITUDES.
    """

    rig: Rig
    free: Rig
    resonance: float
    rates: tuple[AtRate, ...]
    reaches: Mapping[MotorLimits, tuple[tuple[robust.Reach, robust.Reach], ...]]


def study(
    rig: Rig,
    free: Rig,
    rates: Sequence[float],
    motors: Sequence[MotorLimits] = (),
    progress: Callable[[str, float], None] = lambda step, share: None,
    sets: Sequence[Uncertainty | None] = (),
) -> Study:
    """Return the study of a rig's actuator. free: a rig whose ends are the lightest load.

    sets: what the controller must tolerate, at each rate; None: what `assumed` says.

    Raises ParameterError where the synthesis finds no gains, or where `free` is clamped at both ends.
    """
    if not rates:
        raise ParameterError("no rate, expected at least one, Hz")
    loads = load_range(rig, free)
    clamped, light = loads[LOCKED], uncertainty.with_ends(rig, free)
    resonance = natural_frequency(clamped)
    done = []
    for k, rate in enumerate(rates):
        progress(f"{rate:g} Hz", k / len(rates))
        designed = design(rig, loads, rate, u=sets[k] if sets else None)
        done.append(_at_rate(clamped, light, loads, designed))
    limits = {motor: (motor.torque, motor.speed) for motor in motors}
    reaches = {
        motor: tuple((robust.reach(clamped, a, *most), robust.reach(light, a, *most)) for a in AMPLITUDES)
        for motor, most in limits.items()
    }
    return Study(clamped, light, resonance, tuple(done), reaches)


def natural_frequency(rig: Rig) -> float:
    """Return the lowest natural frequency of a rig's open loop, Hz."""
    poles = np.linalg.eigvals(state_space(rig).a)
    return float(np.abs(poles[np.abs(poles) > 0.0]).min()) / (2.0 * math.pi)


def _at_rate(clamped: Rig, light: Rig, loads: Mapping[str, Rig], designed: ControllerDesign) -> AtRate:
    swept = robust.robustness(clamped, loads, designed, steps=3)
    grid = np.geomspace(0.1, 0.45 * designed.rate, 300)
    near = follow(clamped, clamped, designed)
    u = designed.uncertainty
    far = follow(hard(loads, u), clamped, designed, late=u.samples)
    apart = robust.spread(clamped, loads, designed, (LOCKED,))
    softest = robust.softness(clamped, designed, grid)
    return AtRate(
        designed,
        swept,
        tuple(trials(clamped, loads, designed, swept, near, far, apart, softest.worst)),
        tuple(compensations(clamped, designed)),
        near,
        follow(light, clamped, designed),
        apart,
        robust.spread(clamped, loads, designed),
        impedance(clamped, designed.rate, designed.gains, grid),
        softest,
    )
