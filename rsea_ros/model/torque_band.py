"""Whether there is a torque, and how its power lies about the edge of the band of pure torque.

The edge is where |T_d / T_p| of this rig leaves its tolerance in dB or in degrees, exact and damped
(transfer.py). One state-variable filter with two outputs splits the torque there:

    high = s^2 / D,   low = w^2 / D,   D = s^2 + sqrt(2) w s + w^2   (Butterworth, power complementary)

For a sine of frequency f high = -(f / f_c)^2 low at every instant, so the ratio of their powers does not
ripple, and it crosses 1 at the edge f_c; of several sines their powers are shares of the whole. Trapezoidal
integration with w = tan(pi f_c dt) keeps the corner, and for every dt: stamps may jitter.
Source: Zavalishin, The Art of VA Filter Design, 2018, section 4.4.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri  # chi2.isf, without the 0.3 s of scipy.stats

from rsea_ros.compiler import njit
from rsea_ros.model.equations import with_structure
from rsea_ros.model.observer import ErrorModel, TorqueEstimate
from rsea_ros.model.pure_torque_error import AGAIN, SUMS, mean_squares
from rsea_ros.model.rig import Rig, check_two_torques
from rsea_ros.model.transfer import end_to_end, flat_band
from rsea_ros.records.record import HUGE, FloatArray, is_measured

DAMPING = math.sqrt(2.0)
SEEN = 0.45
"""Corner that the filter can have at most, in sample rates."""
LENGTH = 256
"""Samples in the longest window."""
WINDOW = 0.02
"""s over which power is measured."""
SURPRISE, FAINT = (float(chdtri(1, p)) for p in (1e-8, 0.01))
"""Times the noise's power that are a torque: one that begins, with a false alarm of 1e-8 a window (with 50 a
second once in 500 hours), and one that goes on, so that it is not lost at every crossing of zero."""
DEAF = (math.inf, math.inf, 1.0)
"""NOISE_HIGH, NOISE_LOW, SIGMA with which nothing is heard: until it is calibrated."""

FIRST, SECOND, SAMPLED, IS_THERE, HEARD, LAST, HIGH, LOW, MEMORY = range(SUMS, SUMS + 9)
"""In `memory`, after the sums of the window: integrators; time of the last sample in the filter; if there
is a torque, when it was heard last, time of the last estimate (s), powers (N^2 m^2)."""
NOISE_HIGH, NOISE_LOW, SIGMA, QUIET = range(4)
"""In `limits`: N^2 m^2, the sigma of the torque with which that is so, N m, and after how long without a
torque there is none, s."""


class Pair(NamedTuple):
    """State of the filter. memory: shape (MEMORY,). squares: t (s), high^2, low^2, shape (LENGTH, 3)."""

    memory: FloatArray
    squares: FloatArray


def empty_pair() -> Pair:
    """Return a pair without samples."""
    pair = Pair(np.zeros(MEMORY), np.zeros((LENGTH, 3)))
    pair.memory[[SAMPLED, HEARD, LAST]] = math.nan, -math.inf, -math.inf
    return pair


@njit(cache=True, nogil=True, error_model="numpy")
def powers(pair, corner, t, torque, window=WINDOW):  # type: ignore[no-untyped-def]
    """Process a torque (N m) at t (s); return the mean squares of high and low over the window (s), N^2 m^2.

    corner: Hz. After a pause that is too long for the corner the pair restarts.
    """
    memory, squares = pair
    dt = t - memory[SAMPLED]
    memory[SAMPLED] = t
    if not 0.0 < dt * corner < SEEN:
        memory[:SUMS], memory[FIRST], memory[SECOND] = 0.0, 0.0, torque
        return 0.0, torque * torque
    g = math.tan(math.pi * corner * dt)
    high = (torque - (DAMPING + g) * memory[FIRST] - memory[SECOND]) / (1.0 + g * (DAMPING + g))
    band = g * high + memory[FIRST]
    low = g * band + memory[SECOND]
    memory[FIRST], memory[SECOND] = g * high + band, g * band + low
    return mean_squares(memory, squares, window, t, high, low)


@njit(cache=True, nogil=True, error_model="numpy")
def hear(pair, limits, corner, t, torque, sigma):  # type: ignore[no-untyped-def]
    """Process a torque (N m) and its sigma at a later t (s), and note in memory whether there is one."""
    memory = pair.memory
    if t <= memory[LAST]:
        return
    memory[LAST] = t
    if not (math.isfinite(torque) and math.isfinite(sigma)):
        memory[IS_THERE] = 0.0
        return
    memory[HIGH], memory[LOW] = powers(pair, corner, t, torque)
    times = max(1.0, (sigma / limits[SIGMA]) ** 2) * (FAINT if memory[IS_THERE] else SURPRISE)
    if memory[HIGH] > times * limits[NOISE_HIGH] or memory[LOW] > times * limits[NOISE_LOW]:
        memory[IS_THERE], memory[HEARD] = 1.0, t
    elif t - memory[HEARD] > limits[QUIET]:
        memory[IS_THERE] = 0.0


def split(a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray, corner: float, dt: float) -> FloatArray:
    """Return the variances of high and low for the stationary signal c e, e = a e + b v, v of variances r.

    a: shape (n, n), b: (n, m), c: (n,), r: (m,). corner: Hz. dt: s.
    """
    g, n = math.tan(math.pi * corner * dt), len(a)
    to_high = np.array([-(DAMPING + g), -1.0, 1.0]) / (1.0 + g * (DAMPING + g))  # of s_1, s_2, input
    to_band = g * to_high + np.array([1.0, 0.0, 0.0])
    to_low = g * to_band + np.array([0.0, 1.0, 0.0])
    steps = np.array([g * to_high + to_band, g * to_band + to_low])
    whole = np.block([[a, np.zeros((n, 2))], [np.outer(steps[:, 2], c @ a), steps[:, :2]]])
    drive = np.vstack([b, np.outer(steps[:, 2], c @ b)])
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


class Occupied(NamedTuple):
    """share_above: of the power above the edge. hz: of a sine with that share. nan without a torque."""

    share_above: float
    hz: float


class TorqueBand:
    """The band of one rig, and what of it the observer's estimates at increasing stamps (s) occupy."""

    def __init__(
        self, rig: Rig, tolerance_db: float = 3.0, tolerance_deg: float = 30.0, quiet: float = 0.2
    ) -> None:
        """tolerances: of T_d / T_p. quiet: time without a torque after which there is none, s.

        Raises RigError for a rig without a spring: there is one torque, not two.
        """
        check_two_torques(rig)
        self._function = end_to_end(with_structure(rig))
        self.edge = flat_band(self._function, tolerance_db, tolerance_deg)
        self._limits, self._pair, self._period = np.array([*DEAF, quiet]), empty_pair(), math.nan

    def calibrate(self, error: ErrorModel, dt: float) -> None:
        """Set the noise floor from the noise of the estimates at a sample period of dt s.

        With noise that is not finite, as of an observer that does not settle, no torque is heard.
        """
        floor = np.array([0.0, error.sigma**2])
        if self.edge * dt < SEEN:
            with np.errstate(over="ignore", invalid="ignore"):
                floor = split(error.a, error.k, error.c, error.r, self.edge, dt)
        noise = (*floor, error.sigma)
        self._limits[:QUIET] = noise if np.isfinite(noise).all() else DEAF
        self._period = dt

    def take(self, t: float, estimate: TorqueEstimate) -> bool:
        """Process an estimate; return whether there is a torque. A stamp far back starts another run."""
        if self._pair.memory[LAST] - t > AGAIN:
            self._pair = empty_pair()
        distal = estimate.distal if is_measured(estimate.distal, HUGE) else math.nan
        if math.isfinite(t):
            hear(self._pair, self._limits, self.edge, t, distal, estimate.sigma_distal)
        return bool(self._pair.memory[IS_THERE])

    def occupied(self) -> Occupied:
        """Return what the torque occupies now."""
        memory = self._pair.memory
        if not memory[IS_THERE]:
            return Occupied(math.nan, math.nan)
        above = max(memory[HIGH] - self._limits[NOISE_HIGH], 0.0)
        below = max(memory[LOW] - self._limits[NOISE_LOW], 1e-12)
        turn = math.pi * self._period
        g = math.tan(turn * self.edge) if self._period * self.edge < SEEN else 0.0
        return Occupied(float(above / (above + below)), math.atan((above / below) ** 0.25 * g) / turn)

    def error_at(self, hz: float) -> tuple[float, float]:
        """Return |T_d / T_p|, dB, and its phase, degrees: the error of who takes them for the same."""
        response = self._function(2j * math.pi * hz)
        return 20.0 * math.log10(abs(response)), math.degrees(np.angle(response))
