"""The missing torque: what must be injected for the simulation to follow the record.

The answer is (simulation with a small torque - simulation without it) / its size, so it holds for every rig
that can be simulated: with other effects acting, in a loop, with free ends.

The response of channel c to a torque d at the gear is H_c(f) D(f). Measured less simulated is

    R_c = H_c D + noise of sigma_c,   D ~ prior of spectrum S(f)

and the mean and variance of D given all of R are, at every frequency,

    D = sum_c conj(H_c) R_c / sigma_c^2 / (L + 1 / S),   1 / (L + 1 / S),   L = sum_c |H_c|^2 / sigma_c^2

the smoother of Kalman and of Rauch, Tung and Striebel in its steady state, at the cost of a few Fourier
transforms. S comes from the data's power above the noise (empirical Bayes).
Source: Wiener, Extrapolation, Interpolation and Smoothing of Stationary Time Series, 1949; Anderson, Moore,
Optimal Filtering, 1979, chapter 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rsea_ros.effects import signal_table as st
from rsea_ros.effects.effect import compiled
from rsea_ros.effects.signal_table import Port
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import NOTHING_WITHIN, Machine, build, over_span, sample
from rsea_ros.model.step import OUTPUTS, Calls
from rsea_ros.records.record import FloatArray

Place = Literal["command", "motor", "gear", "spring", "load", "ft", "encoder"]
"""Where a torque or an error acts: at the command, which the measured current shows, or behind that; on the
gear; in the spring; on the end that is free; in what the F/T sensor or the encoder shows."""
PORTS: Mapping[Place, Port] = {
    "command": Port.COMMAND, "motor": Port.MOTOR, "gear": Port.GEAR, "spring": Port.SPRING, "load": Port.GEAR,
    "ft": Port.SENSOR, "encoder": Port.SENSOR,
}  # fmt: skip
_SHARE = 1e-3
"""Of the largest command: the torque whose answer is taken; a linear rig answers alike to any."""


@compiled
def _inject(s, p, x):  # type: ignore[no-untyped-def]
    """Add p[1:], one value a step, at the port p[0]; 5 and 6: on the housing's and on the spring's end."""
    at = s[st.TIME] / s[st.STEP]
    if p[0] == 2.0:
        s[st.GEAR_TORQUE] += p[1 + int(at)]
    elif p[0] == 5.0:
        s[st.HOUSING_TORQUE] += p[1 + int(at)]
    elif p[0] == 6.0:
        s[st.DISTAL_TORQUE] += p[1 + int(at)]
    elif p[0] == 3.0:
        k = int(at + 0.5)
        s[st.SPRING_TORQUE] += 0.5 * (p[k] + p[1 + k]) if s[st.COMMIT] == 1.0 else p[1 + int(at)]
    else:
        k = int(at + 0.5)
        s[st.COMMAND] += p[1 + k]
        if p[0] == 0.0:
            s[st.CURRENT] += p[1 + k]


@dataclass(frozen=True)
class Injector:
    """A rig and its drive. sampled: record times of each channel's samples by its clock, s."""

    rig: Rig
    drive: Drive
    sampled: Mapping[str, FloatArray]

    @property
    def middles(self) -> FloatArray:
        """The middle of each step, s since the record's start."""
        return np.asarray(self.drive.step * (np.arange(len(self.drive.command)) + 0.5))

    @cached_property
    def base(self) -> FloatArray:
        """All OUTPUTS at the ends of the steps, the start first, without anything added."""
        return self._run(None, "gear")

    def answers(self, torque: FloatArray, place: Place) -> dict[str, FloatArray]:
        """Return the response of each sampled channel to a torque (N m, one value a step) at a port."""
        largest = float(np.max(np.abs(torque), initial=0.0))
        if largest == 0.0:
            return {n: np.zeros(len(t)) for n, t in self.sampled.items()}
        drive = self.drive
        size = _SHARE * (1.0 if self.rig.loop else float(np.max(np.abs(drive.command), initial=1e-9)))
        out = (self._run(torque * (size / largest), place) - self.base) * (largest / size)
        at = {n: (t - drive.start) / drive.step for n, t in self.sampled.items()}
        smooth = np.zeros(len(drive.command))
        read = {n: sample(n, out[:, OUTPUTS.index(n)], at[n], smooth) for n in at}
        for n in (n for n, known in self.rig.filters().items() if n in read and known.is_sampled):
            read[n] = self.rig.filters()[n].over(read[n], float(np.median(np.diff(self.sampled[n]))))
        return read

    def raw(self, torque: FloatArray, place: Place) -> FloatArray:
        """Return the response of all OUTPUTS to a torque (N m) at the ends of the steps, the start first."""
        return self._run(torque, place) - self.base

    def quiet(self) -> Injector:
        """Return the same rig at rest, without commands and without effects: its linear part."""
        drive, rig = self.drive, self.rig
        still = replace(drive, command=np.zeros(len(drive.command)), initial=(0.0, 0.0), restarts=())
        return Injector(rig.with_effects(), still, self.sampled)

    def _run(self, torque: FloatArray | None, place: Place) -> FloatArray:
        drive, rig = self.drive, self.rig
        in_loop = len(drive.reference) > 0 or rig.loop is not None
        machine = build(rig, drive.step, drive.drift_time, in_loop=in_loop)
        if torque is not None:
            moves = {True: 5.0, False: 6.0}[rig.end_is_free("housing_end")]
            kind = moves if place == "load" else float(PORTS[place])
            machine = with_injection(machine, torque, PORTS[place], kind)
        drive = replace(drive, origin=0.0, restarts=(), spring=None)
        return over_span(machine, rig, drive, np.empty(0), NOTHING_WITHIN, 0, len(drive.command))


def with_injection(machine: Machine, torque: FloatArray, port: Port, kind: float) -> Machine:
    """Return a machine to which a torque is added at a port, after the effects that act there."""
    calls, at = machine.calls, int(machine.calls.first[port + 1])
    first = calls.first.copy()
    first[port + 1 :] += 1
    series = np.concatenate([[kind], torque, torque[-1:]])
    changed = Calls(
        first=first, address=np.insert(calls.address, at, _inject.address),
        p_at=np.insert(calls.p_at, at, len(calls.p)), x_at=np.insert(calls.x_at, at, 0),
        p=np.concatenate([calls.p, series]), nonlinear=calls.nonlinear or port in (Port.GEAR, Port.SPRING),
    )
    return replace(machine, calls=changed)


@dataclass(frozen=True)
class MissingTorque:
    """Torque that is missing at the gear, N m, at instants t (s since the record's start), with its sd.

    answers: its effect on each channel, at the same instants.
    """

    t: FloatArray
    torque: FloatArray
    sd: float
    answers: Mapping[str, FloatArray]


def missing_torque(
    case: Case, residual: Mapping[str, FloatArray], injector: Injector, period: float, place: Place = "gear"
) -> MissingTorque:
    """Return the missing torque of a simulated case. residual: measured - simulated, by channel.

    period: s, of the instants. place: where it is taken to act; at the encoder it is an angle, rad.
    """
    drive = injector.drive
    count = int(drive.duration / period)
    t = np.asarray(period * np.arange(count), np.float64)
    used = [n for n in residual if n != "motor_torque" or place == "command"]
    size = 2 * count
    answer = _pulse_answers(injector, period, count, place)
    spectra = {n: np.fft.rfft(answer[n], size) for n in used}
    residuals = {n: np.fft.rfft(_on_grid(case, residual[n], n, drive.start + t), size) for n in used}
    noise = {n: case.noise[n] ** 2 for n in used}
    information: FloatArray = np.sum([np.abs(spectra[n]) ** 2 / noise[n] for n in used], axis=0)
    right = np.sum([np.conj(spectra[n]) * residuals[n] / noise[n] for n in used], axis=0)
    prior = _prior(right, information, count)
    d = right / (information + 1.0 / prior)
    variance = 1.0 / (information + 1.0 / prior)
    torque = np.fft.irfft(d, size)[:count]
    answers = {n: np.fft.irfft(d * np.fft.rfft(a, size), size)[:count] for n, a in answer.items()}
    return MissingTorque(t, torque, float(np.sqrt(np.mean(variance))), answers)


def _pulse_answers(injector: Injector, period: float, count: int, place: Place) -> dict[str, FloatArray]:
    """Return the response of every output to 1 N m held over one period, at the periods' ends."""
    if place in ("ft", "encoder"):
        return _at_sensor(place, period, count)
    drive, steps = injector.drive, len(injector.drive.command)
    quiet = injector.quiet()
    hold = max(1, round(period / drive.step))
    pulse = np.zeros(steps)
    pulse[:hold] = 1.0
    out = quiet.raw(pulse, place)
    at = np.minimum(np.rint(period * np.arange(count) / drive.step).astype(np.int64), steps)
    answers = {n: out[at, k] for k, n in enumerate(OUTPUTS)}
    known = {n: f for n, f in injector.rig.filters().items() if f.is_sampled}
    return answers | {n: f.over(answers[n], period) for n, f in known.items()}


def _at_sensor(place: Place, period: float, count: int) -> dict[str, FloatArray]:
    """Return the change of every output by an error of 1 in a sensor; an angle's changes the speed too."""
    answers = {n: np.zeros(count) for n in OUTPUTS}
    if place == "ft":
        answers["ft"][0] = 1.0
    else:
        answers["position"][0] = 1.0
        answers["velocity"][[0, 1]] = 0.5 / period, -0.5 / period
    return answers


def _on_grid(case: Case, values: FloatArray, channel: str, at: FloatArray) -> FloatArray:
    keep = case.mask[channel]
    if not keep.any():
        return np.zeros(len(at))
    return np.asarray(np.interp(at, case.t[channel][keep], values[keep], left=0.0, right=0.0))


def _prior(right: FloatArray, information: FloatArray, count: int) -> FloatArray:
    """Return the spectrum of the torque, per bin: the power of the plain estimate above its noise."""
    information = np.maximum(information, 1e-12 * np.max(information))
    power = np.abs(right / information) ** 2 / count
    width = max(2.0, len(power) / 400.0)
    excess = gaussian_filter1d(power, width) - 1.0 / information
    return np.asarray(np.maximum(excess, 1e-2 / information))
