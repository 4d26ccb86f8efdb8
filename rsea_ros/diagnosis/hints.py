"""Where fits of an effect begin: its typical size, its own other starts, and what the residual shows.

A frequency (unit Hz) begins at the peaks of the residual's spectrum, cycles per revolution at the peaks of
the missing torque's periodogram over the rotor angle; both with the phase found there.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

from rsea_ros.effects.effect import Effect
from rsea_ros.effects.signal_table import Port
from rsea_ros.identification.problem import Case
from rsea_ros.identification.unknowns import WELL_KNOWN
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.signals import FloatArray

STIFFNESS, INERTIA, DAMPING = "spring.stiffness", "rotor.reflected_inertia", "rotor.reflected_damping"
_PEAKS = 2
_GAPS = (0.1, 0.3, 0.6)
_LIMITS = (0.95, 0.85, 0.7, 0.5)
_STIFFER = (4.0, 9.0, 20.0)
"""Than the rig's spring what gives beside it may be: softer is told at once, stiffer hardly shows."""
_FEWEST_PERIODS = 1.5
"""As often a ripple must have repeated over the rotor's travel to be one."""
_MOST_WAVES = 1e7
_CYCLES = np.arange(0.5, 60.0, 0.125)


def starts_of(effect: Effect, case: Case, rig: Rig, outputs: dict[str, FloatArray]) -> list[dict[str, float]]:
    """Return from where fits of an effect begin: its parameters, and values of the rig that go with them."""
    starts = [dict(effect.typical)]
    for p in effect.parameters:
        alternatives = list(p.starts) + (
            [-p.typical] if p.low < 0.0 and not p.logarithmic and p.unit != "rad" else []
        )
        starts += [{**effect.typical, p.name: value} for value in alternatives]
    names = {p.name: p.unit for p in effect.parameters}
    if "cycles_per_revolution" in names:
        return [{**effect.typical, **hint} for hint in _cycle_hints(case, rig)]
    if "gap" in names and "position" in case.measured:
        travel = float(np.ptp(case.measured["position"]))
        return starts + [{**effect.typical, **hint} for hint in _gap_hints(travel, rig)]
    if "limit" in names:
        return [{**effect.typical, "limit": limit} for limit in _limit_hints(case)] or starts
    if {"stiffness", "inertia"} <= set(names):
        return _mode_hints(effect, case, rig, outputs) or starts
    if "stiffness" in names:
        return [{**effect.typical, **_beside_a_train(s["stiffness"], rig)} for s in starts]
    if effect.port is Port.MOTOR and "gain" in names:
        return [_gain_hint(effect, case, rig, outputs)] if "ft" in case.measured else starts
    if "Hz" in names.values():
        frequency = next(n for n, unit in names.items() if unit == "Hz")
        channel = effect.claims.channel if effect.claims.channel in outputs else next(iter(outputs))
        hints = _line_hints(case, channel, outputs[channel], names, frequency, effect)
        return [{**effect.typical, **hint} for hint in hints] or starts
    return starts


def _gap_hints(travel: float, rig: Rig) -> list[dict[str, float]]:
    """Return gaps that are shares of the travel, rad; a spring nearly unknown is as much stiffer then."""
    hints = [{"gap": share * travel} for share in _GAPS]
    if rig.rigid_spring or rig.spread(STIFFNESS) <= WELL_KNOWN:
        return hints
    return hints + [{"gap": share * travel, STIFFNESS: rig[STIFFNESS] / (1.0 - share)} for share in _GAPS]


def _limit_hints(case: Case) -> list[float]:
    """Return where a torque could stop growing, N m: the largest measured, and shares of what is asked."""
    if not isinstance(case.drive, Drive):
        return []
    asked = float(np.max(np.abs(case.drive.command)))
    measured = np.abs(case.measured.get("motor_torque", np.zeros(0)))
    return [float(np.quantile(measured, 0.999))] * bool(len(measured)) + [s * asked for s in _LIMITS]


def _mode_hints(
    effect: Effect, case: Case, rig: Rig, outputs: dict[str, FloatArray]
) -> list[dict[str, float]]:
    """Return starts of a part on a spring of its own, its mode at a peak of the residual."""
    channel = max(outputs.keys() & case.measured.keys(), key=lambda n: _left_of(case, n, outputs[n]))
    peaks = _line_hints(case, channel, outputs[channel], {}, "frequency", effect)
    return [
        {
            **effect.typical,
            **hint,
            "inertia": (hint["stiffness"] + hint[STIFFNESS]) / (2.0 * math.pi * peak["frequency"]) ** 2,
        }
        for hint in _series_hints(rig)
        for peak in peaks[:1]
    ]


def _series_hints(rig: Rig) -> list[dict[str, float]]:
    """Return starts of a spring that gives beside the rig's own, N m/rad.

    The rig's is stiffer then: both in series are what the fit without the effect knows.
    """
    if rig.rigid_spring:
        return []
    own = rig[STIFFNESS]
    return [{"stiffness": k * own, STIFFNESS: own / (1.0 - 1.0 / k)} for k in _STIFFER]


def _beside_a_train(stiffness: float, rig: Rig) -> dict[str, float]:
    """Return a start of a gear train that gives between rotor and spring, N m/rad.

    The rotor moves 1 + K_s / stiffness as far as the spring: the fit without it takes that for more inertia
    and damping.
    """
    farther = 1.0 if rig.rigid_spring else 1.0 + rig[STIFFNESS] / stiffness
    return {"stiffness": stiffness, **{name: rig[name] / farther for name in (INERTIA, DAMPING)}}


def _gain_hint(effect: Effect, case: Case, rig: Rig, outputs: dict[str, FloatArray]) -> dict[str, float]:
    """Return the torque constant, relative to the believed one, that the measured torque tells.

    The motion is the same when all that the motor works against is as much larger.
    """
    mask = case.mask["ft"]
    measured, simulated = case.measured["ft"][mask], outputs["ft"][mask]
    gain = float(simulated @ measured / (simulated @ simulated))
    gain = min(max(gain, effect.main.low), effect.main.high)
    return {effect.main.name: gain, **{name: gain * rig[name] for name in rig.free()}}


def _left_of(case: Case, channel: str, simulated: FloatArray) -> float:
    """Return the RMS of a channel's residual over its noise."""
    left = (case.measured[channel] - simulated)[case.mask[channel]]
    return float(np.sqrt(np.mean(left**2))) / case.noise[channel]


def _line_hints(
    case: Case, channel: str, simulated: FloatArray, names: dict[str, str], frequency: str, effect: Effect
) -> list[dict[str, float]]:
    t, residual = case.t[channel], np.where(case.mask[channel], case.measured[channel] - simulated, 0.0)
    rate = 1.0 / float(np.median(np.diff(t)))
    sine = "amplitude" in names
    bins, level = (
        signal.periodogram(residual, rate, window="hann")
        if sine
        else signal.welch(residual, rate, nperseg=min(1024, len(residual)))
    )
    level = np.where((bins > 1.0) & (bins < 0.49 * rate), level, 0.0)
    hints = []
    for peak in _peaks(level, width=max(3, int(0.5 / (bins[1] - bins[0]))) if sine else 12):
        f = _refined(bins, level, peak)
        hint = {frequency: f}
        if sine:
            hint |= _sine_at(t - case.start, residual, 2.0 * math.pi * f, "phase" in names)
        hints.append(hint)
    return hints


def _sine_at(x: FloatArray, y: FloatArray, pulsation: float, with_phase: bool) -> dict[str, float]:
    """Return amplitude and phase of the sine of a pulsation in y(x)."""
    basis = np.column_stack([np.sin(pulsation * x), np.cos(pulsation * x)])
    a, b = np.linalg.lstsq(basis, y, rcond=None)[0]
    amplitude = {"amplitude": float(math.hypot(a, b))}
    return amplitude | {"phase": float(math.atan2(b, a))} if with_phase else amplitude


def _peaks(level: FloatArray, width: int) -> list[int]:
    """Return the places of the largest values that are more than `width` apart."""
    level, found = level.copy(), []
    for _ in range(_PEAKS):
        k = int(np.argmax(level))
        if level[k] <= 0.0:
            break
        found.append(k)
        level[max(k - width, 0) : k + width + 1] = 0.0
    return found


def _refined(bins: FloatArray, level: FloatArray, k: int) -> float:
    """Return the frequency of a peak between the bins, by a parabola through the logarithms."""
    if not 0 < k < len(level) - 1 or min(level[k - 1 : k + 2]) <= 0.0:
        return float(bins[k])
    a, b, c = np.log(level[k - 1 : k + 2])
    return float(bins[k] + 0.5 * (a - c) / (a - 2.0 * b + c) * (bins[1] - bins[0]))


def _cycle_hints(case: Case, rig: Rig) -> list[dict[str, float]]:
    found = missing_torque(case, rig)
    if found is None:
        return []
    angle, torque = found[0] * rig["gear.ratio"], found[1] - np.mean(found[1])
    every = math.ceil(len(angle) * len(_CYCLES) / _MOST_WAVES)
    angle, torque = angle[::every], torque[::every]
    cycles = _CYCLES[_CYCLES * np.ptp(angle) > 2.0 * math.pi * _FEWEST_PERIODS]
    if not len(cycles):
        return []
    power = np.abs(torque @ np.exp(1j * angle[:, None] * cycles[None, :])) ** 2
    hints = []
    for k in _peaks(power, width=6):
        c = _refined(cycles, power, k)
        hints.append({"cycles_per_revolution": c, **_sine_at(angle, torque, c, True)})
    return hints


def missing_torque(case: Case, rig: Rig) -> tuple[FloatArray, FloatArray] | None:
    """Return the measured position (rad) and the torque that the nominal model lacks for the motion, N m.

    J_m a + b_m v + T - T_m with all but the command measured; None without a position, or for a free housing.
    """
    if (
        not isinstance(case.drive, Drive)
        or "position" not in case.measured
        or "housing_end" not in rig.clamped
    ):
        return None
    t, q = case.t["position"], case.measured["position"]
    v = (
        np.interp(t, case.t["velocity"], case.measured["velocity"])
        if "velocity" in case.measured
        else np.gradient(q, t)
    )
    load = np.interp(t, case.t["ft"], case.measured["ft"]) if "ft" in case.measured else rig[STIFFNESS] * q
    acceleration = (v[2:] - v[:-2]) / (t[2:] - t[:-2])
    steps = np.clip(((t[1:-1] - case.start) / case.drive.step).astype(int), 0, len(case.drive.command) - 1)
    width = max(1, round(float(np.median(np.diff(t))) / case.drive.step))
    around = np.convolve(case.drive.command, np.ones(2 * width) / (2 * width), mode="same")[steps]
    inertia = rig["rotor.reflected_inertia"] + rig["chassis.inertia"]
    torque = inertia * acceleration + rig["rotor.reflected_damping"] * v[1:-1] + load[1:-1] - around
    keep = case.mask["position"][1:-1]
    return q[1:-1][keep], torque[keep]
