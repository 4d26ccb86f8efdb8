"""Where fits of an effect begin: its typical size, its own other starts, and what the residual shows.

A table, the first line that an effect answers to counts. A frequency (unit Hz) begins at the peaks of the
residual's spectrum, cycles per revolution at those of the missing torque's periodogram over the rotor angle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import signal

from rsea_ros.diagnosis.joint_scale import joint_starts, torque_scale
from rsea_ros.diagnosis.residual_peaks import angle_errors, peaks, refined, residual_of, ripples, sine_at
from rsea_ros.effects.dead_zone import RAMP
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.identification.problem import Case
from rsea_ros.identification.unknowns import WELL_KNOWN
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

InitialGuess = dict[str, float]
"""Parameters of an effect, and values of the rig that go with them."""
STIFFNESS, INERTIA, DAMPING = "spring.stiffness", "rotor.reflected_inertia", "rotor.reflected_damping"
_GAPS = (0.1, 0.3, 0.6)
_GAPS_OF_JOINTS = (1e-3, 3e-3, 0.01, 0.03)
"""rad: from a good gear's to a toy servo's; the residual has a minimum of its own about each."""
_LIMITS = (0.95, 0.85, 0.7, 0.5)
_SHOWN = 0.3
"""Of a command: what the measured torque shows less of has not come through."""
_STIFFER = (4.0, 9.0, 20.0)
"""Than the rig's spring what gives beside it may be: softer is told at once, stiffer hardly shows."""
_SEGMENT = 1024
_APART = 12


class ResidualView(NamedTuple):
    """What there is to see: a case, the rig as it is fitted so far, and what that gives for each channel."""

    case: Case
    rig: Rig
    outputs: dict[str, FloatArray]

    def residual(self, channel: str) -> FloatArray:
        """Return what is measured less what is simulated, zero where that is masked."""
        return residual_of(self.case, self.outputs, channel)


def initial_guesses(effect: Effect, seen: ResidualView) -> list[InitialGuess]:
    """Return from where fits of an effect begin; none where it has nothing to act on."""
    own = _own_starts(effect)
    if seen.rig.loop is not None and effect.main.unit == "N m" and not _has("cycles_per_revolution")(effect):
        return joint_starts(effect, torque_scale(seen.case, seen.rig))
    for answers, starts in _RULES:
        if answers(effect):
            return starts(effect, own, seen)
    return own


def _own_starts(effect: Effect) -> list[InitialGuess]:
    """Return the typical values, then each parameter's others beside them, of both signs if there are two."""
    starts = [dict(effect.typical)]
    for p in effect.parameters:
        either_sign = p.low < 0.0 and not p.logarithmic and p.unit != "rad"
        others = [*p.starts, *([-p.typical] if either_sign else [])]
        starts += [{**effect.typical, p.name: value} for value in others]
    return starts


def _ripple(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at what repeats with the rotor's angle; without that there is no ripple."""
    return [{**effect.typical, **hint} for hint in ripples(seen.case, seen.rig, seen.outputs)]


def _eccentric(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at what of the measured angle's error repeats with the rotor's angle."""
    return [{**effect.typical, **hint} for hint in angle_errors(seen.case, seen.rig, seen.outputs)]


def _zone(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at the largest command that the measured torque does not show, N m, and at those with less."""
    case = seen.case
    if not isinstance(case.drive, Drive) or "motor_torque" not in case.measured:
        return own
    steps = np.rint(case.drive.at["motor_torque"]).astype(np.int64) - 1
    asked = np.abs(case.drive.command[np.clip(steps, 0, len(case.drive.command) - 1)])
    silent = asked[case.mask["motor_torque"] & (np.abs(case.measured["motor_torque"]) < _SHOWN * asked)]
    width = (1.0 + RAMP) * float(np.max(silent, initial=0.0))
    return [{**effect.typical, "width": width, "jump": jump} for jump in (0.0, 1.0)] if width else own


def _play(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin also at shares of the travel, rad; a spring that is nearly unknown is as much stiffer then.

    A joint travels far beside its play, whose size no travel shows.
    """
    if seen.rig.loop is not None:
        return [{**effect.typical, "gap": gap} for gap in _GAPS_OF_JOINTS]
    if "position" not in seen.case.measured:
        return own
    travel, rig = float(np.ptp(seen.case.measured["position"])), seen.rig
    hints = [{"gap": share * travel} for share in _GAPS]
    if not rig.rigid_spring and rig.spread(STIFFNESS) > WELL_KNOWN:
        hints += [{"gap": share * travel, STIFFNESS: rig[STIFFNESS] / (1.0 - share)} for share in _GAPS]
    return own + [{**effect.typical, **hint} for hint in hints]


def _limit(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at the largest torque measured, and at shares of what is asked, N m."""
    if not isinstance(seen.case.drive, Drive):
        return own
    asked = float(np.max(np.abs(seen.case.drive.command)))
    limits = [s * asked for s in _LIMITS]
    if "motor_torque" in seen.case.measured:
        limits.insert(0, float(np.quantile(np.abs(seen.case.measured["motor_torque"]), 0.999)))
    return [{**effect.typical, "limit": limit} for limit in limits]


def _mode(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin with a part on a spring of its own, its mode at the highest peak of each channel.

    The rig's spring is stiffer then: both in series are what the fit without the effect knows.
    """
    if seen.rig.rigid_spring:
        return own
    channels = sorted(seen.outputs.keys() & seen.case.measured.keys() - {"motor_torque"})
    found = {round(f): f for n in channels for f in _lines(seen, n, sine=False)[:1]}
    known = seen.rig[STIFFNESS]
    springs = [(k * known, known / (1.0 - 1.0 / k)) for k in _STIFFER]
    return [
        {
            **effect.typical,
            "stiffness": k,
            STIFFNESS: rest,
            "inertia": (k + rest) / (2.0 * math.pi * f) ** 2,
        }
        for f in found.values()
        for k, rest in springs
    ] or own


def _train(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin with less inertia and damping where a gear train gives between rotor and spring.

    The rotor moves 1 + K_s / stiffness as far as the spring: the fit without it takes that for more of both.
    """
    starts = []
    for start in own:
        farther = 1.0 if seen.rig.rigid_spring else 1.0 + seen.rig[STIFFNESS] / start["stiffness"]
        starts.append({**start, **{name: seen.rig[name] / farther for name in (INERTIA, DAMPING)}})
    return starts


def _torque_constant(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at the torque constant, relative to the believed one, that the measured torque tells.

    The motion is the same when all that the motor works against is as much larger.
    """
    if "ft" not in seen.case.measured:
        return own
    mask = seen.case.mask["ft"]
    measured, simulated = seen.case.measured["ft"][mask], seen.outputs["ft"][mask]
    if not simulated.any():
        return own
    gain = float(simulated @ measured / (simulated @ simulated))
    gain = min(max(gain, effect.main.low), effect.main.high)
    return [{**effect.typical, effect.main.name: gain, **{n: gain * seen.rig[n] for n in seen.rig.free()}}]


def _line(effect: Effect, own: list[InitialGuess], seen: ResidualView) -> list[InitialGuess]:
    """Begin at lines in the spectrum of the channel that an effect claims, a sine with its size and phase."""
    channel = effect.claims.channel if effect.claims.channel in seen.outputs else next(iter(seen.outputs))
    names = {p.name for p in effect.parameters}
    frequency = next(p.name for p in effect.parameters if p.unit == "Hz")
    t, residual = seen.case.t[channel] - seen.case.start, seen.residual(channel)
    starts = []
    for f in _lines(seen, channel, sine="amplitude" in names):
        sine = sine_at(t, residual, 2.0 * math.pi * f)
        starts.append({**effect.typical, frequency: f, **{n: sine[n] for n in names & sine.keys()}})
    return starts or own


def _lines(seen: ResidualView, channel: str, sine: bool) -> list[float]:
    """Return the highest peaks of a channel's residual, Hz. sine: as sharp as the record is long."""
    t, residual = seen.case.t[channel], seen.residual(channel)
    rate = 1.0 / float(np.median(np.diff(t)))
    if sine:
        bins, level = signal.periodogram(residual, rate, window="hann")
        apart = max(3, int(0.5 / (bins[1] - bins[0])))
    else:
        bins, level = signal.welch(residual, rate, nperseg=min(_SEGMENT, len(residual)))
        apart = _APART
    level = np.where((bins > 1.0) & (bins < 0.49 * rate), level, 0.0)
    return [refined(bins, level, k) for k in peaks(level, apart)]


def _has(*names: str) -> Callable[[Effect], bool]:
    return lambda effect: set(names) <= {p.name for p in effect.parameters}


_RULES: tuple[
    tuple[Callable[[Effect], bool], Callable[[Effect, list[InitialGuess], ResidualView], list[InitialGuess]]],
    ...,
] = (
    (lambda effect: effect.port is Port.SENSOR and _has("cycles_per_revolution")(effect), _eccentric),
    (_has("cycles_per_revolution"), _ripple),
    (_has("width"), _zone),
    (_has("gap"), _play),
    (_has("limit"), _limit),
    (_has("stiffness", "inertia"), _mode),
    (_has("stiffness"), _train),
    (lambda effect: effect.port is Port.MOTOR and _has("gain")(effect), _torque_constant),
    (lambda effect: any(p.unit == "Hz" for p in effect.parameters), _line),
)
