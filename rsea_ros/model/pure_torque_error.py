"""The error of torque as a source, over a window, with its doubt.

Both are the observer's, and their RMS over the last `window` seconds are compared:

    share = RMS(T_p - T_d) / RMS(T_d) <= tolerance

A sine of frequency f has the share |1/H - 1|, H = T_d / T_p between clamped ends; where that passes the
tolerance is the edge. Its interval is that over b_s and J_m within their spreads and over the trains that are
possible. The verdict changes beyond a hysteresis, and only where the torque is large beside the observer's
doubt of it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.errors import ParameterError
from rsea_ros.model.equations import with_structure
from rsea_ros.model.observer import TorqueEstimate
from rsea_ros.model.rig import Rig, check_two_torques
from rsea_ros.model.transfer import edge_of_error, end_to_end, inner_inertia
from rsea_ros.records.record import HUGE, is_measured
from rsea_ros.records.statistics import Z90

LENGTH = 8192
"""Samples that a window can hold: 0.8 s at 10 kHz."""
ROUNDING = 1e-6
"""Part of the window by which a sample at its very beginning is out, so that stamps may be rounded."""
NEWEST, OLDEST, SUM_ERROR, SUM_TORQUE, SUMS = range(5)
"""In `state`, first: rows of the ring, counted without end, and running sums of squares, N^2 m^2."""
NOTHING, PURE, BEYOND = range(3)
TOLERANCE, WINDOW, HYSTERESIS, QUIET, VERDICT, HEARD, SHARE, LAST, STATE = range(SUMS, SUMS + 9)
"""In the state, after the sums of the window: settings, verdict, times (s) and share. One array, for each
argument of a compiled function costs 0.1 us a sample."""
AUDIBLE = 2.0
"""Torque times tolerance that can be judged, in sigmas of the observer's T_p and T_d together."""
AGAIN = 1.0
"""s by which a stamp may be before the last one and of the same run; further back it begins anew."""


@njit(cache=True, nogil=True, error_model="numpy")
def mean_squares(state, ring, window, t, error, torque):  # type: ignore[no-untyped-def]
    """Process an error and a torque (N m) at t (s); return their mean squares over the window (s), N^2 m^2.

    Sums are recomputed once in a round of the ring, so that rounding does not add up. A sample that is not
    finite is left out.
    """
    if not (np.isfinite(error) and np.isfinite(torque)):
        error, torque = 0.0, 0.0
    row, within = int(state[NEWEST]) % len(ring), window * (1.0 - ROUNDING)
    ring[row, 0], ring[row, 1], ring[row, 2] = t, error * error, torque * torque
    state[NEWEST] += 1.0
    state[SUM_ERROR] += error * error
    state[SUM_TORQUE] += torque * torque
    while state[OLDEST] < state[NEWEST] - 1.0:
        old = int(state[OLDEST]) % len(ring)
        if t - ring[old, 0] < within and state[NEWEST] - state[OLDEST] < len(ring):
            break
        state[SUM_ERROR] -= ring[old, 1]
        state[SUM_TORQUE] -= ring[old, 2]
        state[OLDEST] += 1.0
    if row == 0:
        _anew(state, ring)
    count = state[NEWEST] - state[OLDEST]
    return max(state[SUM_ERROR], 0.0) / count, max(state[SUM_TORQUE], 0.0) / count


@njit(cache=True, nogil=True, error_model="numpy")
def _anew(state, ring):  # type: ignore[no-untyped-def]
    state[SUM_ERROR] = state[SUM_TORQUE] = 0.0
    for k in range(int(state[OLDEST]), int(state[NEWEST])):
        state[SUM_ERROR] += ring[k % len(ring), 1]
        state[SUM_TORQUE] += ring[k % len(ring), 2]


@njit(cache=True, nogil=True, error_model="numpy")
def judge_error(state, ring, t, distal, proximal, sigma, heard):  # type: ignore[no-untyped-def]
    """Process both torques and the sum of their sigmas (N m) at a later t (s); return the verdict.

    heard: hold the verdict while the torque is too small to be judged. A sigma that is not finite, of an
    observer that does not settle, is a threshold that no torque passes: NOTHING at once.
    """
    if state[LAST] - t > AGAIN:
        state[:SUMS], state[VERDICT] = 0.0, NOTHING
        state[HEARD] = state[LAST] = -math.inf
    if not t > state[LAST]:
        return int(state[VERDICT])
    state[LAST] = t
    error, torque = mean_squares(state, ring, state[WINDOW], t, proximal - distal, distal)
    least = AUDIBLE * sigma / state[TOLERANCE]
    state[SHARE] = math.nan
    if not np.isfinite(sigma):
        state[VERDICT], state[HEARD] = NOTHING, -math.inf
        return NOTHING
    if torque > least * least:
        state[SHARE] = math.sqrt(error / torque)
        state[VERDICT] = _verdict(state)
    if torque > least * least or heard:
        state[HEARD] = t
    elif not t - state[HEARD] <= state[QUIET]:
        state[VERDICT] = NOTHING
    return int(state[VERDICT])


@njit(cache=True, nogil=True, error_model="numpy")
def _verdict(state):  # type: ignore[no-untyped-def]
    slack = 0.0 if state[VERDICT] == NOTHING else state[HYSTERESIS] * state[TOLERANCE]
    if state[SHARE] > state[TOLERANCE] + slack:
        return BEYOND
    if state[SHARE] <= state[TOLERANCE] - slack:
        return PURE
    return int(state[VERDICT])


ROTOR = "rotor.reflected_inertia"


VERDICTS = ("no torque", "pure", "beyond")
"""In the order of NOTHING, PURE, BEYOND."""


@dataclass(frozen=True)
class ErrorSettings:
    """tolerance: of |T_p - T_d| over |T_d|. window: s over which both are measured, at most 8192 samples; no
    verdict is later than it. hysteresis: part of the tolerance, either way. quiet: s without torque after
    which none is said.

    With less window or hysteresis noise whose share is the tolerance changes the verdict more than once a
    second (decision 386 has the figures).
    """

    tolerance: float = 0.3
    window: float = 0.5
    hysteresis: float = 0.15
    quiet: float = 0.2

    def __post_init__(self) -> None:
        for name, low, high in (("tolerance", 0.01, 1.0), ("window", 0.01, 2.0), ("hysteresis", 0.0, 0.5)):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(f"{name} = {value:g}, expected {low:g} to {high:g}")


class Edge(NamedTuple):
    """Where a sine has the share `tolerance`, Hz: for the rig as stated, and over its uncertain values."""

    hz: float
    low: float
    high: float


class ErrorFlag:
    """The verdict of one rig, fed with the observer's estimates at increasing stamps (s)."""

    def __init__(self, rig: Rig, settings: ErrorSettings | None = None) -> None:
        """Raises RigError for a rig without a spring: there is one torque, not two."""
        check_two_torques(rig)
        s = settings or ErrorSettings()
        self.settings = s
        self.edge = edge_of(with_structure(rig), s.tolerance)
        self._state, self._ring = np.zeros(STATE), np.zeros((LENGTH, 3))  # of t, error^2 and torque^2
        self._state[[TOLERANCE, WINDOW, HYSTERESIS, QUIET]] = s.tolerance, s.window, s.hysteresis, s.quiet
        self._state[[HEARD, SHARE, LAST]] = -math.inf, math.nan, -math.inf
        self.take(-math.inf, TorqueEstimate(*[0.0] * 6))  # compiles, and is too early to count

    def take(self, t: float, estimate: TorqueEstimate, *, heard: bool = False) -> int:
        """Process an estimate and return the verdict: NOTHING, PURE or BEYOND.

        heard: a finer detector (torque_band.py) sees a torque that may be too small to be judged here.
        """
        distal, proximal, _, sigma_distal, sigma_proximal, _ = estimate
        sigma = sigma_distal + sigma_proximal
        if not is_measured(distal, HUGE) or not is_measured(proximal, HUGE):
            distal = proximal = math.nan
        if math.isnan(t):
            return int(self._state[VERDICT])
        return int(judge_error(self._state, self._ring, t, distal, proximal, sigma, heard))

    @property
    def verdict(self) -> str:
        """What is true now; the flag is up when it is `pure`."""
        return VERDICTS[int(self._state[VERDICT])]

    @property
    def share(self) -> float:
        """RMS(T_p - T_d) / RMS(T_d) over the window; nan if the torque is too small."""
        return float(self._state[SHARE])

    @property
    def torque(self) -> float:
        """RMS(T_d) over the window, N m; 0 before the first estimate."""
        count = self._state[NEWEST] - self._state[OLDEST]
        return math.sqrt(max(self._state[SUM_TORQUE], 0.0) / count) if count else 0.0


def edge_of(rig: Rig, tolerance: float) -> Edge:
    """Return where |1/H - 1| reaches a tolerance, and its range over 90 % of b_s and J_m and over trains."""
    edges = [edge_of_error(end_to_end(other), tolerance) for other in _possible(rig)]
    return Edge(edge_of_error(end_to_end(rig), tolerance), min(edges), max(edges))


def _possible(rig: Rig) -> Iterator[Rig]:
    """Yield the rig with its damping and rotor at both ends and in the middle of 90 %, with each train, and
    with the rotor whose spin cancels the chassis where it is between: the edge is highest there."""
    wide = {n: math.exp(Z90 * rig.spread(n)) for n in ("spring.damping", ROTOR) if n in rig.quantities}
    ranges = {n: (rig[n] / w, rig[n], rig[n] * w) for n, w in wide.items()}
    for train in (rig.train, *rig.other_trains):
        turned = replace(rig, train=train)
        rotors = (
            {ROTOR: (*ranges[ROTOR], *_cancelling_inertias(turned, ranges[ROTOR]))} if ROTOR in ranges else {}
        )
        for values in product(*(ranges | rotors).values()):
            yield turned.with_values(dict(zip(ranges, values, strict=True)))


def _cancelling_inertias(rig: Rig, j_m: tuple[float, ...]) -> list[float]:
    """Return the J_m within a range at which J_sc + n J_r = 0, kg m^2, if any."""
    spin = inner_inertia(rig) - rig["chassis.inertia"]
    if not spin:
        return []
    cancelling = -rig["chassis.inertia"] * rig[ROTOR] / spin
    return [cancelling] if min(j_m) < cancelling < max(j_m) else []
