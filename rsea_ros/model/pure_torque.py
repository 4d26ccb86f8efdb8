"""Whether the actuator is a pure torque source now.

It is up to the edge: where |T_d / T_p| of this rig leaves its tolerance in dB or in degrees, exact and damped
(bandwidth.py). The share of the torque's power above the edge is measured by a filter pair; a sine exactly at
the edge has the share `limit`. The verdict changes only when the powers exceed the sensors' noise,
beyond a hysteresis, for a hold time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import chdtri  # chi2.isf, without the 0.3 s of scipy.stats

from rsea_ros.errors import ParameterError
from rsea_ros.model.bandwidth import end_over_end, flat_band
from rsea_ros.model.equations import with_structure
from rsea_ros.model.observer import ErrorModel, TorqueEstimate
from rsea_ros.model.pure_torque_filter import (
    CORNER,
    DAMPING,
    FELL,
    HEARD,
    HIGH,
    LAST,
    LOW,
    MEMORY,
    NOISE_HIGH,
    NOISE_LOW,
    SEEN,
    SIGMA,
    SINCE,
    VERDICT,
    empty_pair,
    update_flag,
)
from rsea_ros.model.rig import Rig, check_two_torques
from rsea_ros.records.record import HUGE, FloatArray, is_measured


def split(a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray, corner: float, dt: float) -> FloatArray:
    """Return the variances of high and low for the stationary signal c e, e = a e + b v, v of variances r.

    a: shape (n, n), b: (n, m), c: (n,), r: (m,). corner: Hz. dt: s.
    """
    g, n = math.tan(math.pi * corner * dt), len(a)
    to_high = np.array([-(DAMPING + g), -1.0, 1.0]) / (1.0 + g * (DAMPING + g))  # of s_1, s_2, input
    to_band = g * to_high + np.array([1.0, 0.0, 0.0])
    to_low = g * to_band + np.array([0.0, 1.0, 0.0])
    steps = np.array([g * to_high + to_band, g * to_band + to_low])
    whole, drive = np.zeros((n + 2, n + 2)), np.zeros((n + 2, b.shape[1]))
    whole[:n, :n], drive[:n] = a, b
    whole[n:, :n], whole[n:, n:], drive[n:] = (
        np.outer(steps[:, 2], c @ a),
        steps[:, :2],
        np.outer(steps[:, 2], c @ b),
    )
    p = _stationary(whole, drive @ np.diag(r) @ drive.T)
    return np.array([_variance(row, a, b, c, r, p) for row in (to_high, to_low)])


def _stationary(a: FloatArray, q: FloatArray) -> FloatArray:
    """Return sum_k a^k q a'^k over the first 2^16 samples, by doubling: also where a has not settled yet."""
    for _ in range(16):
        q = q + a @ q @ a.T
        a = a @ a
    return q


def _variance(
    row: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray, p: FloatArray
) -> float:
    """Return the variance of row . (s_1, s_2, c e) from that of the states before the sample."""
    before = np.concatenate([row[2] * (c @ a), row[:2]])
    now = row[2] * (c @ b)
    return float(before @ p @ before + now @ (r * now))


Verdict = Literal["no torque", "pure", "beyond"]
VERDICTS: tuple[Verdict, ...] = ("no torque", "pure", "beyond")
"""In the order of NOTHING, PURE, BEYOND."""

FALSE_ALARM = 1e-8
"""Probability that noise passes for torque in one window; with 50 windows a second once in 500 hours."""

STILL_THERE = 0.01
"""The same while there is torque: one that is heard is not lost at every crossing of zero."""

DEAF = (math.inf, math.inf, 1.0)
"""Noise in high and low, sigma, with which nothing is heard: until it is calibrated."""


AGAIN = 1.0
"""s by which a stamp may be before the last one and of the same run."""


@dataclass(frozen=True)
class FlagSettings:
    """tolerance_db, tolerance_deg: of T_d / T_p. limit: share of power of a sine at the edge, 0.05 to 0.5.

    hysteresis: part of the edge's frequency, either way. window: over which power is measured; hold_on,
    hold_off: how long the powers must agree before the flag rises and falls; quiet: how long there must be
    no torque before the verdict says so, all in s.
    """

    tolerance_db: float = 3.0
    tolerance_deg: float = 30.0
    limit: float = 0.5
    hysteresis: float = 0.025
    window: float = 0.02
    hold_on: float = 0.005
    hold_off: float = 0.005
    quiet: float = 0.2

    def __post_init__(self) -> None:
        if not 0.05 <= self.limit <= 0.5:
            raise ParameterError(f"limit = {self.limit:g}, expected a share from 0.05 to 0.5")


class PureTorqueVerdict(NamedTuple):
    """Verdict, share of the power above the edge, and the frequency of a sine with that share, Hz.

    Share and frequency are nan when there is no torque.
    """

    verdict: Verdict
    share_above: float
    occupied: float


class PureTorque:
    """The flag of one rig, fed with the observer's estimates at increasing stamps (s)."""

    def __init__(self, rig: Rig, settings: FlagSettings | None = None) -> None:
        """Raises RigError for a rig without a spring: there is one torque, not two."""
        check_two_torques(rig)
        s = settings or FlagSettings()
        self._function = end_over_end(with_structure(rig))
        self.edge = flat_band(self._function, s.tolerance_db, s.tolerance_deg)
        odds = (1.0 - s.limit) / s.limit
        corner = self.edge * odds**0.25
        on, off = ((1.0 + sign * s.hysteresis) ** 4 / odds for sign in (-1.0, 1.0))
        surprise, faint = (float(chdtri(1, p)) for p in (FALSE_ALARM, STILL_THERE))
        values = max(1.0, 2.0 * corner * s.window)  # independent ones of the noise in a window
        self._limits = np.array(
            [corner, s.window, *DEAF, surprise, faint, s.quiet, on, off, values, s.hold_on, s.hold_off]
        )
        self._memory = np.zeros(MEMORY)
        self._memory[[HEARD, SINCE, LAST, FELL]] = -math.inf
        self._pair, self._period = empty_pair(), math.nan

    @property
    def verdict(self) -> Verdict:
        """The present verdict; the flag is up when it is `pure`."""
        return VERDICTS[int(self._memory[VERDICT])]

    def calibrate(self, error: ErrorModel, dt: float) -> None:
        """Set the noise floor from the noise of the estimates at a sample period of dt s.

        With noise that is not finite, as of an observer that does not settle, the flag ignores every torque.
        """
        corner = self._limits[CORNER]
        floor = np.array([0.0, error.sigma**2])
        if corner * dt < SEEN:
            with np.errstate(over="ignore", invalid="ignore"):
                floor = split(error.a, error.k, error.c, error.r, corner, dt)
        heard = (*floor, error.sigma)
        self._limits[[NOISE_HIGH, NOISE_LOW, SIGMA]] = heard if np.isfinite(heard).all() else DEAF
        self._period = dt

    def take(self, t: float, estimate: TorqueEstimate) -> Verdict:
        """Process an estimate and return the verdict. A stamp far before the last one starts another run."""
        if self._memory[LAST] - t > AGAIN:
            self._memory[:] = 0.0
            self._memory[[HEARD, SINCE, LAST, FELL]] = -math.inf
            self._pair = empty_pair()
        distal = estimate.distal if is_measured(estimate.distal, HUGE) else math.nan
        if math.isfinite(t):
            update_flag(self._pair, self._limits, self._memory, t, distal, estimate.sigma_distal)
        return self.verdict

    def reading(self) -> PureTorqueVerdict:
        """Return the present reading of the powers."""
        if self.verdict == "no torque":
            return PureTorqueVerdict(self.verdict, math.nan, math.nan)
        above = max(self._memory[HIGH] - self._limits[NOISE_HIGH], 0.0)
        below = max(self._memory[LOW] - self._limits[NOISE_LOW], 1e-12)
        turn, corner = math.pi * self._period, self._limits[CORNER]
        g = math.tan(turn * corner) if self._period * corner < SEEN else 0.0
        occupied = math.atan((above / below) ** 0.25 * g) / turn
        return PureTorqueVerdict(self.verdict, float(above / (above + below)), occupied)

    def error_at(self, hz: float) -> tuple[float, float]:
        """Return |T_d / T_p|, dB, and its phase, degrees: the error of who takes them for the same."""
        response = self._function(2j * math.pi * hz)
        return 20.0 * math.log10(abs(response)), math.degrees(np.angle(response))
