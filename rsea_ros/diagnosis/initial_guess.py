"""Where the fit of an effect begins: guesses from the residual, and the peaks that the residual has.

A torque that repeats with the rotor is sought in the missing torque, over the measured angle: the simulated
one of a 502:1 gear loses its phase.

The typical sizes of the catalogue are those of an actuator of some 20 N m; a servo of 1 N m would stick fast.
For a joint in a position loop, the largest torque bounds the size of an effect in N m.

A fit without the missing effect may carry a value far from the rig's, to imitate it: a lag of the motor's
current becomes sixteen times the rotor's damping. A fit of the right effect that begins there can end in a
poor minimum, where one that begins at the stated values does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.effects.effect import Effect
from rsea_ros.effects.guess import Guess, ResidualView
from rsea_ros.effects.signal_table import ROTOR_ANGLE, Port
from rsea_ros.identification.missing_torque import Injector, missing_torque
from rsea_ros.identification.problem import Case, Problem, residual_of
from rsea_ros.identification.start import LARGEST, torque_size
from rsea_ros.identification.unknowns import WELL_KNOWN, theta_with
from rsea_ros.model.drive import Drive
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.inverse import Motion, smooth
from rsea_ros.model.rig import Rig, field_of
from rsea_ros.records.record import BoolArray, FloatArray
from rsea_ros.records.statistics import on_even_clock, power_density

_FEWEST_PERIODS = 2.0
"""As often a ripple must have repeated over the rotor's travel: one period may be anything."""
_FEWEST, _MOST = 0.5, 60.0
"""Cycles per revolution of a ripple that is looked for; the catalogue's bound is 60 too."""
_REVOLUTIONS = 8
"""After so many every whole multiple of 1/8 cycle repeats."""
_BINS = 1 << 13
"""Of these revolutions: 17 in a period of the fastest ripple."""
_BINS_PER_TURN, _PADDED = 4, 8
"""Sums in a revolution, of a product that varies over eight; points of the spectrum in one of its lines."""
_PEAKS_APART = 6
"""Lines of 1/8 cycle between two peaks that count as two: over one revolution a peak is as wide."""
_MOST_PEAKS = 2
"""Each is a guess to simulate, so few. All of these steer where fits begin, and no verdict."""


def ripples(case: Case, rig: Rig, outputs: Mapping[str, FloatArray]) -> list[dict[str, float]]:
    """Return cycles per revolution, amplitude (N m) and phase (rad) of the strongest repetitions."""
    along = torque_along(case, rig, outputs)
    if along is None:
        return []
    position, torque = along
    ratio = rig["gear.ratio"]
    angle, torque = ratio * position, torque - np.mean(torque)
    cycles = _repetitions(angle, torque)
    if isinstance(case.drive, Motion):
        keep = case.mask["motor_torque"]
        sines = [_sine_along(case.drive, keep, torque, c * ratio) for c in cycles]
    else:
        sines = [sine_at(angle, torque, c) for c in cycles]
    return [{"cycles_per_revolution": c, **sine} for c, sine in zip(cycles, sines, strict=True)]


def angle_errors(case: Case, rig: Rig, outputs: Mapping[str, FloatArray]) -> list[dict[str, float]]:
    """Return cycles per revolution of the rotor, amplitude (rad) and phase (rad) of the strongest ones.

    Of the measured angle less the simulated one.
    """
    if not isinstance(case.drive, Drive) or "position" not in case.measured:
        return []
    keep = case.mask["position"]
    angle = train_ratio(rig) * case.measured["position"][keep]
    error = residual_of(case, outputs, "position")[keep]
    error = error - np.mean(error)
    return [{"cycles_per_revolution": c, **sine_at(angle, error, c)} for c in _repetitions(angle, error)]


def _sine_along(motion: Motion, keep: BoolArray, torque: FloatArray, pulsation: float) -> dict[str, float]:
    """Return amplitude and phase (rad) of a sine of the angle in the torque missing along a filtered motion.

    The filter of the motion keeps only what passes slowly: the sine that is fitted is filtered alike.
    """
    period = float(motion.t[1] - motion.t[0])
    waves = [motion.compared(smooth(wave(pulsation * motion.q), period))[keep] for wave in (np.sin, np.cos)]
    return _sum_of(waves, torque)


def _repetitions(angle: FloatArray, values: FloatArray) -> list[float]:
    """Return cycles per revolution of the strongest repetitions of zero-mean values over an angle (rad)."""
    cycles, power = _periodogram(angle, values)
    resolvable = (cycles >= _FEWEST) & (cycles * np.ptp(angle) > 2.0 * math.pi * _FEWEST_PERIODS)
    power = np.where(resolvable & (cycles < _MOST), power, 0.0)
    return [_sharpened(angle, values, float(cycles[k])) for k in peaks(power, apart=_PEAKS_APART)]


def _sharpened(angle: FloatArray, values: FloatArray, cycles: float) -> float:
    """Return where within a line of 1/8 cycle a repetition is strongest, as sharply as the travel resolves.

    values exp(-i cycles angle) varies slowly with the angle: a spectrum of its sums over quarter revolutions.
    """
    turns = (angle - angle.min()) / (2.0 * math.pi)
    travel = float(turns.max())
    slow = values * np.exp(-2.0j * math.pi * cycles * turns)
    bins = max(math.ceil(_BINS_PER_TURN * travel), 8)
    place = np.minimum((turns / travel * bins).astype(np.int64), bins - 1)
    sums = np.bincount(place, slow.real, bins) + 1j * np.bincount(place, slow.imag, bins)
    power = np.fft.fftshift(np.abs(np.fft.fft(sums, _PADDED * bins)) ** 2)
    off = np.fft.fftshift(np.fft.fftfreq(_PADDED * bins, travel / bins))
    near = np.flatnonzero(np.abs(off) <= 1.0 / _REVOLUTIONS)
    power, off = power[near], off[near]
    return cycles + interpolate_peak(off, power, int(np.argmax(power)))


def _periodogram(angle: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cycles per revolution and their power: a sum over bins of the angle, folded where all repeat."""
    folded = (angle / (2.0 * math.pi * _REVOLUTIONS) % 1.0 * _BINS).astype(np.int64) % _BINS
    power = np.abs(np.fft.rfft(np.bincount(folded, torque, _BINS))) ** 2
    return np.arange(len(power)) / _REVOLUTIONS, power


def torque_along(
    case: Case, rig: Rig, outputs: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    """Return the measured angle of the gear (rad) and the torque that is missing at the gear there, N m.

    outputs: simulated channels of the case. None where nothing that was measured shows that angle.
    """
    if isinstance(case.drive, Motion):
        keep = case.mask["motor_torque"]  # the torque missing there is what the motor did not need
        return case.drive.q[keep], (outputs["motor_torque"] - case.measured["motor_torque"])[keep]
    channel, per_unit = _angle_shown(case, rig)
    if not channel:
        return None
    t, keep = case.t[channel], case.mask[channel]
    residual = {n: residual_of(case, outputs, n) for n in outputs}
    injector, period = Injector(rig, case.drive, case.t), float(np.median(np.diff(t)))
    missing = missing_torque(case, residual, injector, period)
    middle = case.drive.start + missing.t + 0.5 * period
    known = np.interp(middle, t, keep.astype(float)) == 1.0
    return per_unit * np.interp(middle, t, case.measured[channel])[known], missing.torque[known]


def _angle_shown(case: Case, rig: Rig) -> tuple[str, float]:
    """Return a channel that shows the gear's angle, and rad per its unit; an empty name where none does.

    Beyond a spring whose far end is held, deflection is that angle, and F/T that angle times the stiffness.
    """
    shown = {"position": 1.0}
    if {"housing_end", "spring_end"} <= rig.clamped:
        shown |= {"deflection": 1.0}
        shown |= {"ft": 1.0 / rig["spring.stiffness"]} if rig.ft_end == "spring_end" else {}
    return next(((n, per_unit) for n, per_unit in shown.items() if n in case.measured), ("", 0.0))


def peaks(level: FloatArray, apart: int) -> list[int]:
    """Return the places of the largest values that are more than a number of bins apart."""
    level, largest = level.copy(), []
    for _ in range(_MOST_PEAKS):
        k = int(np.argmax(level))
        if level[k] <= 0.0:
            break
        largest.append(k)
        level[max(k - apart, 0) : k + apart + 1] = 0.0
    return largest


def interpolate_peak(bins: FloatArray, level: FloatArray, k: int) -> float:
    """Return where between the bins a peak is, by a parabola through the logarithms."""
    if not 0 < k < len(level) - 1 or min(level[k - 1 : k + 2]) <= 0.0:
        return float(bins[k])
    a, b, c = np.log(level[k - 1 : k + 2])
    return float(bins[k] + 0.5 * (a - c) / (a - 2.0 * b + c) * (bins[1] - bins[0]))


def sine_at(x: FloatArray, y: FloatArray, pulsation: float) -> dict[str, float]:
    """Return amplitude and phase (rad) of the sine of a pulsation in y(x)."""
    return _sum_of([np.sin(pulsation * x), np.cos(pulsation * x)], y)


def _sum_of(waves: list[FloatArray], y: FloatArray) -> dict[str, float]:
    """Return amplitude and phase (rad) of the sum of a sine and a cosine that is nearest to y."""
    a, b = np.linalg.lstsq(np.column_stack(waves), y, rcond=None)[0]
    return {"amplitude": float(math.hypot(a, b)), "phase": float(math.atan2(b, a))}


_SEGMENT = 1024
"""Samples of a segment of the spectrum in which a mode is looked for: at 280 Hz lines of 0.27 Hz, a third of
the width 2 zeta f of a mode of 20 Hz with zeta = 0.02. These numbers steer where fits begin, no verdict."""
_APART = 12
"""Lines between two peaks of it that count as two: 3.3 Hz at 280 Hz, four such widths."""
_SHARP_APART = 0.5
"""Hz between two lines that count as two: mains and its neighbours stay one."""
_LOWEST, _HIGHEST = 1.0, 0.49
"""Hz and share of the rate between which peaks are looked for: below is drift, above only half the rate."""
_SHARES = (0.03, 0.1, 0.3)
"""Of a joint's largest torque: what friction, ripple and their like may have."""
_LIMITS = (1.0, 0.9, 0.7)
"""Of the same: where a limit of the torque may begin."""


def initial_guesses(effect: Effect, view: RecordView) -> list[Guess]:
    """Return the guesses from which fits of an effect begin; empty where it has nothing to act on."""
    if view.rigid_spring and effect.port is Port.SPRING:
        return []
    is_torque = effect.main.unit == "N m" and ROTOR_ANGLE not in effect.reads
    if view.is_joint and is_torque:
        return joint_guesses(effect, torque_size(view.case, view.rig))
    defaults = effect.default_guesses
    return defaults if effect.guesses is None else effect.guesses(defaults, view)


def joint_guesses(effect: Effect, largest: float) -> list[Guess]:
    """Return guesses of an effect whose main parameter is a torque, by the largest torque of a joint, N m."""
    main = effect.main
    shares = _LIMITS if "limit" in effect.tags else _SHARES
    sizes = {min(max(share * largest, main.low), main.high) for share in shares}
    torques = [p.name for p in effect.parameters if p.unit == "N m"]
    return [
        {**effect.typical, **{name: size * effect.typical[name] / main.typical for name in torques}}
        for size in sorted(sizes)
    ]


@dataclass(frozen=True)
class RecordView(ResidualView):
    """A case beside the rig fitted so far and its simulated channels (effects/guess.py)."""

    case: Case
    rig: Rig
    outputs: dict[str, FloatArray]

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(self.outputs)

    @property
    def measured(self) -> frozenset[str]:
        return frozenset(self.case.measured)

    @property
    def free(self) -> tuple[str, ...]:
        return tuple(self.rig.free())

    @property
    def rigid_spring(self) -> bool:
        return self.rig.rigid_spring

    @property
    def is_joint(self) -> bool:
        return self.rig.loop is not None

    def value(self, name: str) -> float:
        return self.rig[name]

    def is_well_known(self, name: str) -> bool:
        return self.rig.spread(name) <= WELL_KNOWN

    def travel(self) -> float | None:
        position = self.case.measured.get("position")
        return None if position is None else float(np.ptp(position))

    def largest_command(self) -> float | None:
        drive = self.case.drive
        return float(np.max(np.abs(drive.command))) if isinstance(drive, Drive) else None

    def largest_motor_torque(self) -> float | None:
        torque = self.case.measured.get("motor_torque")
        return None if torque is None else float(np.quantile(np.abs(torque), LARGEST))

    def largest_unanswered_command(self, share: float) -> float | None:
        case = self.case
        if not isinstance(case.drive, Drive) or "motor_torque" not in case.measured:
            return None
        steps = np.rint(case.drive.at["motor_torque"]).astype(np.int64) - 1
        commanded = np.abs(case.drive.command[np.clip(steps, 0, len(case.drive.command) - 1)])
        is_silent = np.abs(case.measured["motor_torque"]) < share * commanded
        return float(np.max(commanded[case.mask["motor_torque"] & is_silent], initial=0.0))

    def gain(self, channel: str) -> float | None:
        if channel not in self.case.measured:
            return None
        mask = self.case.mask[channel]
        measured, simulated = self.case.measured[channel][mask], self.outputs[channel][mask]
        return float(simulated @ measured / (simulated @ simulated)) if simulated.any() else None

    def lines(self, channel: str, is_sharp: bool) -> list[float]:
        t, residual = self.case.t[channel], residual_of(self.case, self.outputs, channel)
        rate = 1.0 / float(np.median(np.diff(t)))
        is_whole = not (isinstance(self.case.drive, Drive) and self.case.drive.spans)
        if (is_sharp or is_whole) and np.abs((t - t[0]) * rate - np.arange(len(t))).max() > 0.5:
            residual = on_even_clock(t, residual, rate)
        if is_sharp:
            bins, level = power_density(residual, rate, len(residual))
            apart = max(3, int(_SHARP_APART / (bins[1] - bins[0])))
        else:
            bins, level = power_density(residual, rate, min(_SEGMENT, len(residual)))
            apart = _APART
        level = np.where((bins > _LOWEST) & (bins < _HIGHEST * rate), level, 0.0)
        return [interpolate_peak(bins, level, k) for k in peaks(level, apart)]

    def sine(self, channel: str, frequency: float) -> Guess:
        t = self.case.t[channel] - self.case.start
        return sine_at(t, residual_of(self.case, self.outputs, channel), 2.0 * math.pi * frequency)

    def repeating_torque(self) -> list[Guess]:
        return ripples(self.case, self.rig, self.outputs)

    def repeating_angle(self) -> list[Guess]:
        return angle_errors(self.case, self.rig, self.outputs)


def view_for(
    effect: Effect, cases: Sequence[Case], rig: Rig, outputs: Sequence[dict[str, FloatArray]]
) -> RecordView:
    """Return the first case in which an effect acts, preferably one of the rig as it is."""
    differs = [rig.condition(case.source) for case in cases]
    k = min(range(len(cases)), key=lambda i: 1 + (effect.name in c.without) if (c := differs[i]) else 0)
    return RecordView(cases[k], rig.under(cases[k].source), outputs[k])


def stated_starts(problem: Problem, theta: FloatArray, effect: Effect) -> list[FloatArray]:
    """Return theta with the values that the rig states, once for each default guess of an effect in it."""
    stated = problem.rig.free()
    rig = {u.name: u.start for u in problem.unknowns if field_of(u.name) in stated}
    guesses = [{f"{effect.name}.{name}": v for name, v in g.items()} for g in effect.default_guesses]
    return [theta_with(problem.unknowns, theta, {**rig, **guess}) for guess in guesses]
