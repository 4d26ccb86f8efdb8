"""The torque that a model lacks, by input estimation: a smoother over all channels, with its uncertainty.

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
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from rsea_ros.identification.problem import Case
from rsea_ros.laws.injection import Injector
from rsea_ros.laws.terms import Place
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import FloatArray


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
    return {n: out[at, k] for k, n in enumerate(OUTPUTS)}


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
