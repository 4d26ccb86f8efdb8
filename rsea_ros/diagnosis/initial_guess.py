"""Initial guesses of an effect's parameters, from the residual and from the stated values.

The typical sizes of the catalogue are those of an actuator of some 20 N m; a servo of 1 N m would stick fast.
For a joint in a position loop, the largest torque bounds the size of an effect in N m.

A fit without the missing effect may carry a value far from the rig's, to imitate it: a lag of the motor's
current becomes sixteen times the rotor's damping. A fit of the right effect that begins there can end in a
poor minimum, where one that begins at the stated values does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.residual_peaks import (
    angle_errors,
    interpolate_peak,
    on_even_clock,
    peaks,
    residual_of,
    ripples,
    sine_at,
)
from rsea_ros.effects.effect import Effect
from rsea_ros.effects.guess import Guess
from rsea_ros.effects.signal_table import ROTOR_ANGLE, Port
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.start import LARGEST, torque_size
from rsea_ros.identification.unknowns import WELL_KNOWN, theta_with
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray
from rsea_ros.records.spectra import power_density

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
class RecordView:
    """A case beside the rig fitted so far and its simulated channels (effects/guess.py)."""

    case: Case
    rig: Rig
    outputs: dict[str, FloatArray]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the simulated channels."""
        return tuple(self.outputs)

    @property
    def measured(self) -> frozenset[str]:
        """Names of the measured channels."""
        return frozenset(self.case.measured)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the rig's values that a fit may move."""
        return tuple(self.rig.free())

    @property
    def rigid_spring(self) -> bool:
        """Whether the rig has no spring."""
        return self.rig.rigid_spring

    @property
    def is_joint(self) -> bool:
        """Whether the firmware closes a position loop."""
        return self.rig.loop is not None

    def value(self, name: str) -> float:
        """Return a value of the rig as fitted so far, SI."""
        return self.rig[name]

    def is_well_known(self, name: str) -> bool:
        """Return whether the rig's prior of a value is narrow."""
        return self.rig.spread(name) <= WELL_KNOWN

    def travel(self) -> float | None:
        """Return how far the measured position goes, rad; None without that channel."""
        position = self.case.measured.get("position")
        return None if position is None else float(np.ptp(position))

    def largest_command(self) -> float | None:
        """Return the largest commanded torque, N m; None for a record of a measured motion."""
        drive = self.case.drive
        return float(np.max(np.abs(drive.command))) if isinstance(drive, Drive) else None

    def largest_motor_torque(self) -> float | None:
        """Return the largest measured motor torque but for outliers, N m; None without that channel."""
        torque = self.case.measured.get("motor_torque")
        return None if torque is None else float(np.quantile(np.abs(torque), LARGEST))

    def largest_unanswered_command(self, share: float) -> float | None:
        """Return the largest command of which the measured motor torque shows less than a share, N m."""
        case = self.case
        if not isinstance(case.drive, Drive) or "motor_torque" not in case.measured:
            return None
        steps = np.rint(case.drive.at["motor_torque"]).astype(np.int64) - 1
        commanded = np.abs(case.drive.command[np.clip(steps, 0, len(case.drive.command) - 1)])
        is_silent = np.abs(case.measured["motor_torque"]) < share * commanded
        return float(np.max(commanded[case.mask["motor_torque"] & is_silent], initial=0.0))

    def gain(self, channel: str) -> float | None:
        """Return the factor that brings the simulated channel nearest to the measured one; None without."""
        if channel not in self.case.measured:
            return None
        mask = self.case.mask[channel]
        measured, simulated = self.case.measured[channel][mask], self.outputs[channel][mask]
        return float(simulated @ measured / (simulated @ simulated)) if simulated.any() else None

    def lines(self, channel: str, is_sharp: bool) -> list[float]:
        """Return the highest peaks of a residual's spectrum, Hz. is_sharp: as sharp as the record is long."""
        t, residual = self.case.t[channel], residual_of(self.case, self.outputs, channel)
        rate = 1.0 / float(np.median(np.diff(t)))
        if is_sharp and isinstance(self.case.drive, Drive) and self.case.drive.spans:
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
        """Return amplitude and phase (rad) of the sine of a frequency (Hz) in a residual."""
        t = self.case.t[channel] - self.case.start
        return sine_at(t, residual_of(self.case, self.outputs, channel), 2.0 * math.pi * frequency)

    def repeating_torque(self) -> list[Guess]:
        """Return cycles per revolution, amplitude (N m), phase (rad) of the torque that follows the rotor."""
        return ripples(self.case, self.rig, self.outputs)

    def repeating_angle(self) -> list[Guess]:
        """Return the same of the measured angle's error, amplitude in rad."""
        return angle_errors(self.case, self.rig, self.outputs)


def stated_starts(problem: Problem, theta: FloatArray, effect: Effect) -> list[FloatArray]:
    """Return theta with the values that the rig states, once for each default guess of an effect in it."""
    stated = problem.rig.free()
    rig = {u.name: u.start for u in problem.unknowns if u.name in stated}
    guesses = [{f"{effect.name}.{name}": v for name, v in g.items()} for g in effect.default_guesses]
    return [theta_with(problem.unknowns, theta, {**rig, **guess}) for guess in guesses]
