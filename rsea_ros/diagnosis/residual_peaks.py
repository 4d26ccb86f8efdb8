"""Peaks of the residual: over frequency, and of the missing torque over the rotor's angle.

The missing torque is the torque that a model lacks for the measured motion:

    J_m a + b_m v + T,   of the residuals: measured less simulated motion and load

The parts that the model has right, the command with its lags included, cancel. A simulated rotor angle of a
502:1 gear loses its phase; the measured one does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.inverse import Motion, smooth
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, FloatArray

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
_APART = 6
"""Lines of 1/8 cycle between two peaks that count as two: over one revolution a peak is as wide."""
_MOST_PEAKS = 2
"""Each is a guess to simulate, so few. All of these steer where fits begin, and no verdict."""


def ripples(case: Case, rig: Rig, outputs: Mapping[str, FloatArray]) -> list[dict[str, float]]:
    """Return cycles per revolution, amplitude (N m) and phase (rad) of the strongest repetitions."""
    missing = missing_torque(case, rig, outputs)
    if missing is None:
        return []
    position, torque = missing
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
    waves = [smooth(wave(pulsation * motion.q), period)[keep] for wave in (np.sin, np.cos)]
    return _sum_of(waves, torque)


def _repetitions(angle: FloatArray, values: FloatArray) -> list[float]:
    """Return cycles per revolution of the strongest repetitions of zero-mean values over an angle (rad)."""
    cycles, power = _periodogram(angle, values)
    resolvable = (cycles >= _FEWEST) & (cycles * np.ptp(angle) > 2.0 * math.pi * _FEWEST_PERIODS)
    power = np.where(resolvable & (cycles < _MOST), power, 0.0)
    return [_sharpened(angle, values, float(cycles[k])) for k in peaks(power, apart=_APART)]


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


def missing_torque(
    case: Case, rig: Rig, outputs: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    """Return the measured position (rad) and the torque that is missing at it, N m.

    outputs: simulated channels of the case. None without a position, or for a free housing.
    """
    if isinstance(case.drive, Motion):
        return _along(case.drive, case, outputs)
    if "position" not in case.measured or "housing_end" not in rig.clamped:
        return None
    t, q = case.t["position"], residual_of(case, outputs, "position")
    v = _residual_at(t, case, outputs, "velocity", np.gradient(q, t))
    a = np.pad((v[2:] - v[:-2]) / (t[2:] - t[:-2]), 1)
    load = _residual_at(t, case, outputs, "ft", _load(rig, q, v, a))
    inertia = rig["rotor.reflected_inertia"] + rig["chassis.inertia"]
    torque = (inertia * a + rig["rotor.reflected_damping"] * v + load)[1:-1]
    keep = case.mask["position"][1:-1]
    return case.measured["position"][1:-1][keep], torque[keep]


def _along(motion: Motion, case: Case, outputs: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the angles of a measured motion (rad), and the torque that its motor did not need, N m."""
    keep = case.mask["motor_torque"]
    return motion.q[keep], (outputs["motor_torque"] - case.measured["motor_torque"])[keep]


def _residual_at(
    t: FloatArray, case: Case, outputs: Mapping[str, FloatArray], channel: str, otherwise: FloatArray
) -> FloatArray:
    """Return the residual of a channel at the stamps t, s; `otherwise`, shape of t, without that channel."""
    if channel not in case.measured:
        return otherwise
    return np.interp(t, case.t[channel], residual_of(case, outputs, channel))


def _load(rig: Rig, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return the torque, N m, that carries a motion beyond the gear: of the spring, or of the load itself."""
    if not rig.rigid_spring:
        return rig["spring.stiffness"] * q
    inertia, damping, stiffness = (rig[f"spring_end.{n}"] for n in ("inertia", "damping", "stiffness"))
    return inertia * a + damping * v + stiffness * q


def residual_of(case: Case, outputs: Mapping[str, FloatArray], channel: str) -> FloatArray:
    """Return measured less simulated, zero where masked."""
    return np.where(case.mask[channel], case.measured[channel] - outputs[channel], 0.0)


def on_even_clock(t: FloatArray, values: FloatArray, rate: float) -> FloatArray:
    """Return values at a rate (Hz) from the first stamp to the last, zero where none is near."""
    place = np.rint((t - t[0]) * rate).astype(np.int64)
    even = np.zeros(place[-1] + 1)
    even[place] = values
    return even


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
