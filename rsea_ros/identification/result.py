"""The result of an identification: parameters, which of them the data determine, slow ramps, remarks.

Slow ramps against a locked output show travel, stiffness and limit without a dynamic model. Their torque is
the measured motor torque where present, so friction of motor and gear is in all three.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import MASKED, ComplexArray, Fault, FloatArray, Record

SLOW = 1.0
"""Hz. RMS frequency of a command up to which inertia and damping count for nothing."""
AT_END = 0.975
"""Of the largest command: from here on a ramp is at its end."""
LOADED = (0.5, 0.95)
"""Of the largest torque: where the stiffness is read off, clear of backlash and of the turning points."""
UNLOADED = 0.05
SATURATED = 0.9
"""Of the command at its ends: motor torque below this is at a limit."""


@dataclass(frozen=True)
class Statics:
    """Torque against angle of a locked output.

    torque: N m, the ramps go from -torque to +torque. travel: rad, between those ends. stiffness: N m/rad,
    slope of the flanks while the load grows. lost_motion: rad, between the two directions at zero torque.
    limit: N m, at which the motor torque stops following the command; None where it follows to the end.
    """

    torque: float
    travel: float
    stiffness: float
    lost_motion: float
    limit: float | None


def statics_of(record: Record, rig: Rig) -> Statics | None:
    """Return the statics of a record of slow ramps on a rig with both ends clamped, None for any other,
    and where the angle does not grow with the load."""
    held = rig.clamped.issuperset(END_NAMES) and not rig.rigid_spring
    if not held or "position" not in record or _rms_frequency(record) > SLOW:
        return None
    t, angle = record["position"].t, record["position"].y
    command = np.interp(t, record["command"].t, record["command"].y)
    end = float(min(command.max(), -command.min()))
    if end <= 0.0:
        return None
    acting = record["motor_torque" if "motor_torque" in record else "command"]
    torque = np.interp(t, acting.t, acting.y)
    forward, backward = command >= AT_END * end, command <= -AT_END * end
    reached = float(np.median(np.abs(torque[forward | backward])))
    stiffness = _stiffness(command, torque, angle)
    if not np.isfinite(stiffness) or not (forward.any() and backward.any()):
        return None
    return Statics(
        torque=end, travel=float(np.median(angle[forward]) - np.median(angle[backward])),
        stiffness=stiffness, lost_motion=_lost_motion(command, angle, end),
        limit=reached if reached < SATURATED * end else None,
    )


def _rms_frequency(record: Record) -> float:
    """Return the RMS frequency of the command, Hz: its rate over itself."""
    t, y = record["command"].t, record["command"].y
    rate = np.diff(y) / np.diff(t)
    deviation = float(np.std(y))
    return float(np.sqrt(np.mean(rate**2))) / (2.0 * np.pi * deviation) if deviation > 0.0 else np.inf


def _stiffness(command: FloatArray, torque: FloatArray, angle: FloatArray) -> float:
    """Return torque per angle while the load grows, one line for each direction, N m/rad."""
    peak = float(np.quantile(np.abs(torque), 0.99))
    growing = (np.gradient(np.abs(command)) > 0.0) & (np.abs(command) < peak)
    size, bend = 0.0, 0.0
    for sign in (1.0, -1.0):
        flank = growing & (sign * torque > LOADED[0] * peak) & (sign * torque < LOADED[1] * peak)
        if flank.any():
            load = torque[flank] - torque[flank].mean()
            size, bend = size + float(load @ load), bend + float(load @ angle[flank])
    return size / bend if bend > 0.0 else np.inf


def _lost_motion(command: FloatArray, angle: FloatArray, end: float) -> float:
    """Return the angle between falling and rising command at zero torque, rad; nan where one is missing."""
    rising, unloaded = np.gradient(command) > 0.0, np.abs(command) < UNLOADED * end
    down, up = angle[unloaded & ~rising], angle[unloaded & rising]
    return float(np.median(down) - np.median(up)) if len(down) and len(up) else float("nan")


Code = Literal[
    "even_clocks",
    "clocks_taken_as_right",
    "torque_by_motor_constant",
    "torque_by_loop_gains",
    "at_bound",
    "not_shown",
    "only_prior",
    "only_ratios",
    "only_together",
    "play_undetermined",
    "also_in_model",
    "coherence_lost",
    "on_measured_angle",
    "coloured_noise",
    "off_rig",
    "differs",
    "other_records",
    "stretches",
    "lost_cycles",
    "unseen_spring",
]
"""What a remark says.

even_clocks: stamps of channels scatter (s RMS) about an even clock, which is used.
clocks_taken_as_right: where the data ask for no correction; were they unknown, the interval of a value would
be so many times as wide.
torque_by_…: nothing but that says how large the torques are.
at_bound: a value ran to its bound (value, unit).
not_shown, only_prior: a value is not identifiable; the data do not show it, or only the rig's prior holds it.
only_ratios, only_together: values that are not identifiable each.
play_undetermined: of a gear, by its best gap (rad) and the gain of that.
also_in_model: effects that the extended model has and that are no causes.
coherence_lost: of a channel with the command, above a frequency (Hz).
on_measured_angle: an effect was simulated on the measured rotor angle.
coloured_noise: of channels, taken from the residual.
off_rig: the rig states a value, the data another (that, 95 % interval), so many of its stated spreads away.
differs: a record differs from the rig, and how. other_records: of which the rig has conditions for nothing.
stretches: of long records so many s were used, of so many.
unseen_spring: its mode (Hz) lies above the rate (Hz) of the records, and it was taken as rigid.
lost_cycles: so many cycles of the driver were lost, and the motor torque shows them.
"""


@dataclass(frozen=True)
class Remark:
    """A fact: its code, the parameters, channels or effects concerned, and its numbers."""

    code: Code
    names: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    unit: str = ""


def silent_channels(faults: Iterable[Fault]) -> tuple[str, ...]:
    """Return the sensors of which no sample could be used: dead, or masked throughout."""
    whole = (f.channel for f in faults if f.kind == "dead_channel" or (f.kind in MASKED and f.share >= 1.0))
    return tuple(dict.fromkeys(whole))


def is_unexcited(faults: Iterable[Fault]) -> bool:
    """Return whether the command of a record never changes, so that no cause could have shown itself."""
    return any(f.kind == "no_excitation" for f in faults)


Determined = Literal["yes", "in part", "no"]
IDENTIFIABLE_SHARE = 0.5
"""Share of what is known of a value that the data must have brought for it to be identified."""
_WELL = 0.9
"""The same for a value that the data determine whole."""
_NULL = 1e-9
"""Of the prior's information: what stands in for none, so that data that say nothing give a wide variance."""


def shares_from_data(information: FloatArray, doubt: FloatArray) -> FloatArray:
    """Return for each unknown the share of its information that comes from the data, 0 … 1, shape (n,).

    d^2 / (d^2 + v) with d the doubt before and v the variance that the data alone leave, all other unknowns
    free: 0 where only a ratio with others is determined. information: J'J, shape (n, n).
    """
    scaled = information * np.outer(doubt, doubt) + _NULL * np.eye(len(doubt))
    return np.asarray(1.0 / (1.0 + _variances(scaled)))


def _variances(information: FloatArray) -> FloatArray:
    """Return the variance that an information leaves of each unknown; where rounding leaves it singular,
    directions below the rounding count as unknown."""
    try:
        return np.diag(np.linalg.inv(information))
    except np.linalg.LinAlgError:
        size, vectors = np.linalg.eigh(information)
        return np.asarray(vectors**2 @ (1.0 / np.maximum(size, _NULL)))


def how_determined(name: str, value: float, ci95: tuple[float, float], share: float) -> Determined:
    """Return how well data determine a value, relative to its prior and to its size.

    "no" where the interval reaches as far as the value is large, or where the fit ended at a bound.
    """
    low, high = ci95
    at_bound = value in ci95 and low < high
    size = math.pi if name.endswith((".phase", "gravity_angle")) else abs(value)
    if share < IDENTIFIABLE_SHARE or at_bound or not max(high - value, value - low) < size:
        return "no"
    return "yes" if share >= _WELL else "in part"


Verdict = Literal["adequate", "misfit", "not_identifiable"]
"""Whether the model fits down to the noise, and if so, whether the data determine any of its values."""
AT_NOISE, FAR_FROM_NOISE = 1.1, 2.0
"""RMS of a residual over the noise, up to which it is the noise; from which most of it is something else."""


@dataclass(frozen=True)
class FrequencyResponse:
    """A measured frequency response with its doubt.

    frequency: Hz, shape (n,). response: output per input, complex, shape (n,). coherence: 0 … 1, shape (n,).
    sd: standard deviation of the complex response (circular), same unit as response, shape (n,).
    noise, distortion: output amplitude (RMS per line) of noise and of nonlinear distortion, where the
    excitation allows to separate them, else None.
    """

    input: str
    output: str
    frequency: FloatArray
    response: ComplexArray
    coherence: FloatArray
    sd: FloatArray
    method: str
    noise: FloatArray | None = None
    distortion: FloatArray | None = None


CLOCKS = ("clock.", "clock_rate.")
"""What the names of the sensors' clocks begin with."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter in SI with its 95 % interval.

    told_by_data: share of its information that comes from the data, 1 - var(posterior) / var(prior).
    start: the value that the rig stated. spread: relative one-sigma prior spread around it. spreads_off:
    distance of the value from it in spreads. beside_misfit: the residual is far from the noise, so that the
    interval says nothing of what the missing law does to the value.
    """

    name: str
    value: float
    unit: str
    ci95: tuple[float, float]
    start: float
    spread: float
    told_by_data: float
    spreads_off: float = 0.0
    beside_misfit: bool = False

    @property
    def is_identifiable(self) -> bool:
        """Return whether the data determine the value, rather than the rig's prior."""
        return self.told_by_data >= IDENTIFIABLE_SHARE

    @property
    def determined(self) -> Determined:
        """Return how well the data determine the value: beside a misfit in part at most."""
        how = how_determined(self.name, self.value, self.ci95, self.told_by_data)
        return "in part" if self.beside_misfit and how == "yes" else how


@dataclass(frozen=True)
class Overlay:
    """A channel of a record as measured and as simulated: s, and the channel's unit."""

    channel: str
    t: FloatArray
    measured: FloatArray
    simulated: FloatArray


@dataclass(frozen=True)
class Identification:
    """Parameters with confidence, their fit to the record, and values that the data cannot determine.

    rig: the rig with the identified values. residual_rms, noise_rms: by channel, in its unit.
    fit_percent: 100 (1 - ||e|| / ||y - mean y||) by channel. models: the fitted model's response at the
    frequencies of each of `responses`. remarks: on values that are not identifiable, and on corrected stamps.
    statics: of slow ramps against a locked output. alternatives: laws that would explain a part of the
    misfit; the intervals span their estimates. coloured: channels whose residual was taken for
    coloured noise of the sensor. clocks: cost of unknown clocks of the sensors.
    """

    rig: Rig
    sources: tuple[str, ...]
    duration: float
    rate: float
    parameters: tuple[ParameterEstimate, ...]
    correlation: FloatArray
    residual_rms: Mapping[str, float]
    noise_rms: Mapping[str, float]
    fit_percent: Mapping[str, float]
    responses: tuple[FrequencyResponse, ...] = ()
    models: tuple[ComplexArray, ...] = ()
    overlays: tuple[Overlay, ...] = ()
    statics: Statics | None = None
    remarks: tuple[Remark, ...] = ()
    notes: tuple[str, ...] = field(default=())
    faults: tuple[Fault, ...] = field(default=())
    alternatives: tuple[str, ...] = ()
    coloured: tuple[str, ...] = ()
    clocks: tuple[Remark, ...] = ()
    rig_choice: RigChoice = field(default_factory=RigChoice)

    @property
    def times_noise(self) -> dict[str, float]:
        """Return by channel the RMS of the residual over the noise."""
        noise = self.noise_rms
        return {n: v / noise[n] for n, v in self.residual_rms.items() if noise.get(n, 0.0) > 0.0}

    @property
    def at_noise(self) -> bool:
        """Return whether every channel that counts is at its noise."""
        return all(ratio <= AT_NOISE for ratio in self.times_noise.values())

    @property
    def silent(self) -> tuple[str, ...]:
        """Return the sensors that measure nothing: the model was not held against them."""
        return silent_channels(self.faults)

    @property
    def verdict(self) -> Verdict:
        """Return whether the model fits the measurements, and whether they determine any value.

        A sensor that measures nothing is a misfit: the model predicts its measurement.
        """
        if not self.at_noise or self.silent:
            return "misfit"
        physical = [p for p in self.parameters if not p.name.startswith(CLOCKS)]
        return "adequate" if any(p.is_identifiable for p in physical) or not physical else "not_identifiable"
