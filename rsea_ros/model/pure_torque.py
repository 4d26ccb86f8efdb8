"""Is the actuator a pure torque source for the torque that it transmits now?

It is up to the edge: where |T_d / T_p| of this rig leaves its tolerance in dB or in degrees, exact and damped
(bandwidth.py). The share of the torque's power above the edge is measured by a filter pair; a sine exactly at
the edge has the share `limit`. The verdict changes only when the powers tell it through the sensors' noise,
beyond a hysteresis, for a hold time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import chi2

from rsea_ros.errors import ParameterError
from rsea_ros.model.bandwidth import end_to_end, flat_band
from rsea_ros.model.observer import ErrorModel, Estimate
from rsea_ros.model.pure_torque_filter import empty_pair, powers, split
from rsea_ros.model.rig import Rig

Verdict = Literal["no torque", "pure", "beyond"]

FALSE_ALARM = 1e-8
"""Probability that noise passes for torque in one window; with 50 windows a second once in 500 hours."""

FAINT = 0.01
"""The same while there is torque: one that is heard is not lost at every crossing of zero."""

DECIDED = 3.0
"""Sigmas by which the powers must tell on which side of the edge the torque is."""


@dataclass(frozen=True)
class Settings:
    """tolerance_db, tolerance_deg: of T_d / T_p. limit: share of power of a sine at the edge, 0.05 to 0.5.

    hysteresis: part of the edge's frequency, either way. window: over which power is measured; hold_on,
    hold_off: how long the powers must say so before the flag rises and falls; quiet: how long there must be
    no torque before that is said, all in s.
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


class Floor(NamedTuple):
    """What the sensors' noise alone makes of the powers, N^2 m^2, while the sigma of T_d is so, N m."""

    high: float
    low: float
    sigma: float


class Reading(NamedTuple):
    """Verdict, share of the power above the edge, and the frequency of a sine with that share, Hz.

    Share and frequency are nan when there is no torque.
    """

    verdict: Verdict
    share_above: float
    occupied: float


class PureTorque:
    """The flag of one rig, fed with the observer's estimates at increasing stamps (s)."""

    def __init__(self, rig: Rig, settings: Settings | None = None) -> None:
        self.settings = s = settings or Settings()
        self._function = end_to_end(rig)
        self.edge = flat_band(self._function, s.tolerance_db, s.tolerance_deg)
        odds = (1.0 - s.limit) / s.limit
        self._corner = self.edge * odds**0.25
        self._on, self._off = ((1.0 + sign * s.hysteresis) ** 4 / odds for sign in (-1.0, 1.0))
        self._values = max(1.0, 2.0 * self._corner * s.window)  # independent ones of the noise in a window
        self._surprise, self._faint = (float(chi2.isf(p, 1)) for p in (FALSE_ALARM, FAINT))
        self._pair, self._floor = empty_pair(), Floor(math.inf, math.inf, 1.0)
        self._verdict: Verdict = "no torque"
        self._heard = self._since = -math.inf
        self._last, self._powers, self._period = math.nan, (0.0, 0.0), math.nan

    @property
    def verdict(self) -> Verdict:
        """What is true now; the flag is up when it is `pure`."""
        return self._verdict

    def calibrate(self, error: ErrorModel, dt: float) -> None:
        """Take in what the sensors' noise makes of the estimates at a sample period of dt s."""
        seen = self._corner * dt < 0.45
        high, low = (
            split(error.a, error.k, error.c, error.r, self._corner, dt) if seen else (0.0, error.sigma**2)
        )
        self._floor, self._period = Floor(float(high), float(low), error.sigma), dt

    def take(self, t: float, estimate: Estimate) -> Verdict:
        """Take in an estimate and return the verdict."""
        if t <= self._last:
            return self._verdict
        self._last = t
        self._powers = powers(self._pair, self._corner, self.settings.window, t, estimate.distal)
        excess = max(1.0, (estimate.sigma_distal / self._floor.sigma) ** 2)
        self._decide(t, *self._powers, self._floor.high * excess, self._floor.low * excess)
        return self._verdict

    def reading(self) -> Reading:
        """Return what the powers say now."""
        if self._verdict == "no torque":
            return Reading(self._verdict, math.nan, math.nan)
        above = max(self._powers[0] - self._floor.high, 0.0)
        below = max(self._powers[1] - self._floor.low, 1e-12)
        ratio, turn = above / below, math.pi * self._period
        g = math.tan(turn * self._corner) if turn * self._corner < 0.45 * math.pi else 0.0
        return Reading(self._verdict, above / (above + below), math.atan(ratio**0.25 * g) / turn)

    def error_at(self, hz: float) -> tuple[float, float]:
        """Return |T_d / T_p|, dB, and its phase, degrees: the error of who takes them for the same."""
        response = complex(self._function(2j * math.pi * hz))
        return 20.0 * math.log10(abs(response)), math.degrees(np.angle(response))

    def _decide(self, t: float, high: float, low: float, noise_high: float, noise_low: float) -> None:
        times = self._surprise if self._verdict == "no torque" else self._faint
        if high > times * noise_high or low > times * noise_low:
            self._heard = t
        elif t - self._heard > self.settings.quiet:
            self._verdict, self._since = "no torque", t
            return
        wanted = self._wanted(high - noise_high, low - noise_low, noise_high, noise_low)
        hold = self.settings.hold_on if wanted == "pure" else self.settings.hold_off
        if wanted == self._verdict:
            self._since = t
        elif t - self._since >= hold:
            self._verdict, self._since = wanted, t

    def _wanted(self, high: float, low: float, noise_high: float, noise_low: float) -> Verdict:
        """Return what the powers without their noise say, or the verdict as it is when that is too little."""
        spread_high, spread_low = (
            2.0 * n * n + 4.0 * n * max(p, 0.0) / self._values
            for n, p in ((noise_high, high), (noise_low, low))
        )
        if high - self._off * low > DECIDED * math.sqrt(spread_high + self._off**2 * spread_low):
            return "beyond"
        if self._on * low - high > DECIDED * math.sqrt(spread_high + self._on**2 * spread_low):
            return "pure"
        return self._verdict
