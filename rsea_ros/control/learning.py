"""Learning of load, inertia, damping and friction while the bench runs.

    w            = theta . (stretch of the spring, two parts of what follows the load)
    u - T        = J w' + b w + c tanh(w / creep)          u: torque that was commanded
    m - T        = J w' + b w + c tanh(w / creep)          m: torque that acted, by the measured current

w is the speed of the gear against the housing, linear in its parameters for a torque with an unknown load:

    w = theta_0 s T / (K_s + b_s s) + theta_1 s T / (s + w_1)^2 + theta_2 w_1 s T / (s + w_1)^3

The first part stretches the spring (theta_0 = 1 if K_s is
right), the others follow the load: an inertia J_l gives way by T / (J_l s), so that theta_1 is 1 / J_l, 0 for
a load that stands still; damping and gravity come with theta_2. All three have stable poles whatever theta
is, and none of them answers to a torque that stands: a motor that waits at a torque is not sent away.

Three least-squares fits with forgetting over the same samples, every signal through the same band pass,
weighed against the rig's values:

    (R + s^2 P) x = r + s^2 P x_0,     s^2 = the larger of the floor and what the fit leaves

R, r are means of the last MEMORY s in which the gear moved. What is learned shapes the feed-forward of the
desired torque alone: it is bounded and has stable poles, so no error in it can make the loop unstable, and
the margins of the design hold whatever has been learned. On a path that is later than the design's, the
second fit makes the feed-forward lead; the third says what of the measured torque that explains, which is no
disturbance. Recursive least squares with forgetting: Astrom,
Wittenmark, Adaptive Control, 1995, ch. 2; an inverse from it: Widrow, Walach, Adaptive Inverse Control, 1996.
"""

import math

import numpy as np
from scipy.linalg import expm

from rsea_ros.control.law import FeedbackLaw
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

SLOW = 2.0 * math.pi * 1.5
"""w_1, rad/s: below 1.5 Hz the motion of the load is left to feedback."""

LOCKED: FloatArray = np.array([1.0, 0.0, 0.0])


class Stretch:
    """phi of a spring, rad, and its mean rate over a sample, for a torque that goes straight in it."""

    def __init__(self, stiffness: float, damping: float, period: float) -> None:
        """SI."""
        a = stiffness / damping if damping > 0.0 else math.inf
        self._pole = math.exp(-a * period)
        after = (1.0 - self._pole) / (a * period) if math.isfinite(a) else 0.0
        self._on = ((after - self._pole) / stiffness, (1.0 - after) / stiffness)
        self._compliance, self._period = 1.0 / stiffness, period
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._phi, self._torque = torque * self._compliance, torque

    def rate(self, torque: float) -> float:
        """Take the torque (N m) at the end of a sample; return the mean rate over it, rad/s."""
        phi = self._pole * self._phi + self._on[0] * self._torque + self._on[1] * torque
        rate = (phi - self._phi) / self._period
        self._phi, self._torque = phi, torque
        return rate


class Yielding:
    """The motion with the load: the parts of theta_1 and theta_2, at the samples."""

    def __init__(self, period: float) -> None:
        n = 3
        generator = np.zeros((n + 1, n + 1))
        generator[:n, :n] = -SLOW * np.eye(n) + np.diag(np.ones(n - 1), -1)
        generator[0, n] = 1.0
        held = expm(generator * period)
        self._a, self._b = held[:n, :n], held[:n, n]
        self._c: FloatArray = np.array([[1.0, -SLOW, 0.0], [0.0, SLOW, -(SLOW**2)]])
        self.start(0.0)

    def start(self, torque: float) -> None:
        """Begin at rest at a torque, N m."""
        self._z: FloatArray = torque / SLOW ** np.arange(1.0, 4.0)

    def after(self, torque: float) -> FloatArray:
        """Return both parts at the end of a sample with a mean torque, N m: rad/s for theta = 1."""
        parts: FloatArray = self._c @ (self._a @ self._z + self._b * torque)
        return parts

    def advance(self, torque: float) -> FloatArray:
        """Go on by a sample with a mean torque, N m; return the parts at its end."""
        self._z = self._a @ self._z + self._b * torque
        parts: FloatArray = self._c @ self._z
        return parts


MEMORY = 0.5
"""s; two and a half periods of 5 Hz."""
CORNER = 25.0
"""Hz, of the low pass, twice: above it the noise of sensors counts more than motion."""
SLOWEST = 4.0
"""Hz, of the high pass, twice: slower, a load that swings by itself moves the gear without any torque."""
INDEPENDENT = 20.0
"""Samples in the memory that are no repetition of each other: MEMORY times twice the corner, about."""
MOVES = 5e-3
"""rad/s, amplitude: a gear that is slower teaches nothing, and what was learned is kept."""
PAUSE = 0.03
"""s over which that amplitude is taken, by its mean square: single samples above a limit are those to which
noise adds, and half a N m at 4 Hz taught a locked bench a load that was not there, 52 % of error."""
CREEP = 5e-3
"""rad/s, over which the learned friction changes its sign: sharper is sharper than its estimate."""
FLOORS = (4e-3, 0.1)
"""rad/s, N m: the least that a fit leaves, by noise and quanta of the sensors."""
SPREADS = (np.array([0.15, 20.0, 20.0]), np.array([0.2, 0.6, 5.0]))
"""Standard deviations of theta (1, 1/(kg m^2), 1/(kg m^2)); of J and b, of the rig's; of c, N m."""
EVERY = 4
"""Samples after which each fit is solved anew: it costs more than all the rest of a step."""
QUICK = 0.01
"""s, in which a load is seen to be another one: a foot that lands."""
FOLLOWS = 0.1
"""rad/s that the load should turn by for that."""
UNUSUAL = 16.0
"""Times the mean square that the fit leaves, 4 sigma: at 3, an unknown pendulum at 2 Hz was forgotten."""
LIGHTEST = 25.0
"""1/(kg m^2): no load is taken for lighter than 1/25 kg m^2."""
SWINGS = 3.0
"""1/(kg m^2), of theta_2: a load that follows so much may be a pendulum near its own frequency. It is no
inertia there, and its theta_1 is negative: -12 at 2 Hz for one of 1.3 Hz. Noise: 0.3 on a locked bench."""


class Learning:
    """load: theta. drive: J (kg m^2), b (N m s/rad), c (N m) for the commands; acting: for the torque that
    acted."""

    def __init__(self, rig: Rig, law: FeedbackLaw) -> None:
        h = law.period
        self._stretch = Stretch(rig["spring.stiffness"], rig["spring.damping"], h)
        self._yielding = Yielding(h)
        self._period = h
        self._corners = [1.0 - math.exp(-2.0 * math.pi * hz * h) for hz in (CORNER, SLOWEST)]
        self._fresh = 1.0 - math.exp(-h / MEMORY)
        known = np.array([law.inertia, law.damping, 0.0])
        spreads = (SPREADS[0], SPREADS[1] * [law.inertia, law.damping, 1.0])
        self._priors = [(LOCKED, 1.0 / spreads[0] ** 2), (known, 1.0 / spreads[1] ** 2)]
        self._bounds = [
            (np.array([0.8, 0.0, -LIGHTEST]), np.array([1.25, LIGHTEST, 3.0 * LIGHTEST])),
            (np.array([0.5, 0.0, 0.0]) * [*known[:2], 0.0], np.array([2.0, 3.0, 10.0]) * [*known[:2], 1.0]),
        ]
        self.load, self.drive, self.acting = LOCKED, known, known
        self._moments, self._turn = np.zeros((3, 4, 4)), 0
        self.start(0.0, 0.0)

    def start(self, ft: float, velocity: float) -> None:
        """Begin at a torque (N m) and a speed (rad/s); keep the learned values."""
        self._stretch.start(ft)
        self._yielding.start(ft)
        self._ft, self._velocity = ft, velocity
        self._filtered = np.zeros((4, 3, 4))
        self._parts = np.zeros(2)
        self._power, self._powers = 0.0, np.zeros(3)

    def hear(
        self,
        ft: float,
        velocity: float,
        torque: float,
        acted: float,
        *,
        gap: float = 0.0,
        sure: bool = True,
    ) -> None:
        """Process a sample: N m, rad/s; torque: N m, mean of the command over the hold that it ends.

        acted: N m, mean of the measured torque over that hold.
        gap: rad/s, the part of that velocity that crosses backlash and is not the load's. sure: whether that
        is surely the torque that acted; else nothing is learned from it.
        """
        speed, mean = 0.5 * (velocity + self._velocity), 0.5 * (ft + self._ft)
        parts = self._yielding.advance(mean)
        first, second = 0.5 * (parts + self._parts)
        moved = [(velocity - self._velocity) / self._period, speed, math.tanh(speed / CREEP)]
        rows = np.array([
            [self._stretch.rate(ft), first, second, speed - gap],
            [*moved, torque - mean],
            [*moved, acted - mean],
        ])  # fmt: skip
        self._ft, self._velocity, self._parts = ft, velocity, parts
        quick, seen = self._band(rows)
        if self._has_changed(quick[0]):
            self.load, self._moments[0] = LOCKED, 0.0
        self._power += self._period / PAUSE * (max(seen[0, 0] ** 2, seen[0, 3] ** 2) - self._power)
        if sure and self._power > 0.5 * MOVES**2:
            self._moments += self._fresh * (seen[:, :, None] * seen[:, None, :] - self._moments)
            self._turn = (self._turn + 1) % EVERY
            if self._turn == 0:
                self.load = self._solve(0, self.load)
            elif self._turn == EVERY // 2:
                self.drive = self._solve(1, self.drive)
                in_time = self._power_left(2, self.drive) < FLOORS[1] ** 2
                self.acting = self.drive if in_time else self._solve(2, self.acting)

    def _band(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return signals above SLOWEST, and those of them below CORNER."""
        fast, slow = self._corners
        for state in self._filtered[2:]:
            state += slow * (rows - state)
            rows = rows - state
        quick = rows
        for state in self._filtered[:2]:
            state += fast * (rows - state)
            rows = state
        return quick, rows

    def _has_changed(self, rows: FloatArray) -> bool:
        """Return whether the learned load explains the gear's motion worse than none would: it is another."""
        expected, moved = float(self.load[1:] @ rows[1:3]), float(rows[3] - self.load[0] * rows[0])
        powers = np.array([expected**2, moved**2, (moved - expected) ** 2])
        self._powers += self._period / QUICK * (powers - self._powers)
        followed, without, left = self._powers.tolist()
        if followed < FOLLOWS**2 or left < without:
            return False
        return bool(left > UNUSUAL * self._power_left(0, self.load))

    def _power_left(self, which: int, x: FloatArray) -> float:
        """Return the mean square that a solution leaves of a fit."""
        m = self._moments[which]
        return float(m[3, 3] - 2.0 * x @ m[:3, 3] + x @ m[:3, :3] @ x)

    def _solve(self, which: int, before: FloatArray) -> FloatArray:
        """Return the least squares of a fit, within its bounds."""
        m, kind = self._moments[which], min(which, 1)
        known, precision = self._priors[kind]
        weight = max(FLOORS[kind] ** 2, self._power_left(which, before)) / INDEPENDENT * precision
        matrix, right = m[:3, :3] + np.diag(weight), m[:3, 3] + weight * known
        low, high = self._bounds[kind]
        inside = _within(matrix, right, low, high)
        if which == 0 and inside[1] == 0.0 and inside[2] > SWINGS:
            return _within(matrix, right, low - [0.0, LIGHTEST, 0.0], high)
        return inside


def _within(matrix: FloatArray, right: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the solution of matrix x = right within bounds: what exceeds one is set to it, the rest anew."""
    solution = np.linalg.solve(matrix, right)
    inside: FloatArray = np.minimum(np.maximum(solution, low), high)  # np.clip takes four times as long
    free = inside == solution
    if free.all():
        return inside
    rows = matrix[free]
    rest = np.linalg.solve(rows[:, free], right[free] - rows[:, ~free] @ inside[~free])
    inside[free] = np.minimum(np.maximum(rest, low[free]), high[free])
    return inside
