"""The reference and the feed-forward that follows it.

At sample k the model is in the state of the bench at k+1, when the command of this sample begins to act. Its
torque is that of the actuator with both ends held, whatever load there is: the closed loop's nominal torque.
The learned load adds its motion (learning.py). Torque that the limits remove
from a command is removed from the model too, and from the load's part in the same proportion.

The model's torque j samples after the start of a hold is c A^j x + g_j u, with g_j = c (A^(j-1) + … + 1) B.
The command makes it the desired one in the sense of least squares over the first `moves` samples, u held
over them:

    u = sum g_j (r_j + e fade^j - c A^j x) / sum g_j^2

e is what the model's torque differs from the desired one at the start: after a limit it comes back within a
few `fade`, not at once, which would reach the limit again and again. One sample is the exact inverse, which
needs the bench's sampled zeros inside the unit circle and away from -1, where u would jump up and down.
`moves` is the least number for which the inverse does not, or at least is stable, and no less than HORIZON
has: over one sample of 1 kHz an error of 0.1 N m in the desired torque would take 62 N m of the motor, over
three 7. Since u follows from the state of the model, the model may receive another torque than u (a limit),
and nothing winds up.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.law import FT, POSITION, VELOCITY, FeedbackLaw, Sampled
from rsea_ros.control.learning import CREEP, Learning, Yielding
from rsea_ros.effects._friction import mean_tanh
from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray

MOST_MOVES = 8
JUMPY = -0.5
"""A pole of the inverse further left than this makes it jump from sample to sample."""

RECOVERY = 20.0
"""Hz: how fast the model comes back to the desired torque after a limit."""

HORIZON = 3e-3
"""s over which the model is brought to the desired torque."""

FREE = 1e-6
"""An end that turns freely has a pole at 1, which the torque does not show."""


@dataclass(frozen=True)
class Inverse:
    """u = weights · (r + e fading - free x). weights, fading: shape (moves,). free: shape (moves, n)."""

    plant: Sampled
    weights: FloatArray
    free: FloatArray
    fading: FloatArray

    @property
    def moves(self) -> int:
        """How many samples of the desired torque a command looks at."""
        return len(self.weights)

    def torque(self, x: FloatArray, desired: FloatArray, off: float = 0.0) -> float:
        """Return the command, N m. x: the model at the start of the hold. desired: shape (moves,), after it.

        off: N m, torque of the model less the desired one at the start.
        """
        return float(self.weights @ (desired + off * self.fading - self.free @ x))


def inverse(plant: Sampled) -> Inverse:
    """Return the inverse of a bench. Raises ParameterError where none of them is stable."""
    least = min(MOST_MOVES, max(1, round(HORIZON / plant.period)))
    candidates = [_inverse(plant, moves) for moves in range(least, MOST_MOVES + 1)]
    stable = [c for c in candidates if np.abs(inverse_poles(c)).max() < 1.0 + FREE]
    smooth = [c for c in stable if inverse_poles(c).real.min() > JUMPY]
    if stable:
        return (smooth or stable)[0]
    raise ParameterError(
        f"feed-forward: no inverse over {least} to {MOST_MOVES} samples of {1e3 * plant.period:g} ms is "
        "stable, expected a bench whose torque follows the motor"
    )


def inverse_poles(inverse: Inverse) -> FloatArray:
    """Return the poles of the model under its inverse."""
    plant = inverse.plant
    closed = plant.a - np.outer(plant.b, inverse.weights @ inverse.free)
    return np.asarray(np.linalg.eigvals(closed))


def _inverse(plant: Sampled, moves: int) -> Inverse:
    free, forced, x = [], [], np.zeros_like(plant.b)
    power = np.eye(len(plant.a))
    for _ in range(moves):
        x = plant.a @ x + plant.b
        power = plant.a @ power
        free.append(plant.c[FT] @ power)
        forced.append(float(plant.c[FT] @ x))
    g = np.array(forced)
    fade = np.exp(-2.0 * np.pi * RECOVERY * plant.period)
    return Inverse(plant, g / (g @ g), np.array(free), fade ** np.arange(1, moves + 1))


_mean_tanh: Callable[[float, float, float], tuple[float, float]] = mean_tanh.py_func


class Reference:
    """now, next: the outputs of `Sampled` of the model at this sample and at the next one, shape (4,).
    promised: the desired torques (N m) that the model was steered to at these two. turning: the speed that
    the gear should have at this sample with its load, rad/s.
    """

    def __init__(self, plant: Sampled, law: FeedbackLaw, learned: Learning) -> None:
        """plant: the rig with both ends clamped."""
        self._plant, self._inverse, self._law = plant, inverse(plant), law
        self._learned, self._yielding = learned, Yielding(plant.period)
        self.samples = max(self._inverse.moves, 2)
        self.start(0.0, 0.0, 0.0)

    def start(self, ft: float, velocity: float, desired: float) -> None:
        """Begin at the state of the bench, N m and rad/s, and move to a desired torque, N m."""
        seen = self._plant.c[[FT, VELOCITY]]
        self._x: FloatArray = np.linalg.lstsq(seen, np.array([ft, velocity]), rcond=None)[0]
        self.now = self.next = self._plant.c @ self._x
        self.promised = (desired, desired)
        self._yielding.start(ft)
        self._parts, self._held = np.zeros(2), math.nan
        self.turning = self._turning = velocity
        self._angles = np.zeros(2)

    def torque(self, desired: FloatArray) -> float:
        """Return the command, N m, that leads the held actuator to desired torques from k+2 on."""
        off = float(self.next[FT]) - self.promised[1]
        return self._inverse.torque(self._x, desired[: self._inverse.moves], off)

    def _after(self, torque: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the model's state and outputs at the end of the hold of a torque, and the load's parts."""
        if torque != self._held:
            x = self._plant.a @ self._x + self._plant.b * torque
            seen: FloatArray = self._plant.c @ x
            parts = self._yielding.after(0.5 * (float(self.next[FT]) + float(seen[FT])))
            self._held, self._end = torque, (x, seen, parts)
        return self._end

    def motion(self, torque: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return speeds (rad/s) and angles (rad) at the two ends of the hold of a torque, with the load."""
        _, after, parts = self._after(torque)
        speeds = self._speed(self.next, self._parts), self._speed(after, parts)
        begin = float(self.next[POSITION]) + float(self._angles[1])
        return speeds, (begin, begin + 0.5 * self._law.period * sum(speeds))

    def more(self, torque: float) -> tuple[float, float, float]:
        """Return the torque that the load needs beyond the held rig, and beyond the rig's for all of the
        motion the learned drive, as it is commanded and as it acts: N m, means over the hold."""
        _, after, _ = self._after(torque)
        (start, stop), _ = self.motion(torque)
        rise, mean = (stop - start) / self._law.period, 0.5 * (stop + start)
        held_rise = float(after[VELOCITY] - self.next[VELOCITY]) / self._law.period
        held_mean = 0.5 * float(after[VELOCITY] + self.next[VELOCITY])
        inertia, damping = self._law.inertia, self._law.damping
        moved = np.array([rise, mean, mean_friction(start / CREEP, stop / CREEP)])
        nominal = inertia * rise + damping * mean
        commanded, acting = (float(d @ moved) - nominal for d in (self._learned.drive, self._learned.acting))
        return inertia * (rise - held_rise) + damping * (mean - held_mean), commanded, acting

    def advance(self, torque: float, promised: float) -> None:
        """Go on by a sample with a torque (N m) that was to lead to the promised one."""
        speeds, _ = self.motion(torque)
        self._x, seen, self._parts = self._after(torque)
        self.now, self.next, self._held = self.next, seen, math.nan
        self._yielding.advance(0.5 * (float(self.now[FT]) + float(seen[FT])))
        self.turning, self._turning = self._turning, speeds[1]
        step = 0.5 * self._law.period * sum(speeds) - float(self.next[POSITION] - self.now[POSITION])
        self._angles = np.array([self._angles[1], self._angles[1] + step])
        self.promised = (self.promised[1], promised)

    def at(self, part: float) -> tuple[float, float]:
        """Return torque (N m) and speed (rad/s) a number of samples after this one, on a straight line."""
        torque = float(self.now[FT] + part * (self.next[FT] - self.now[FT]))
        return torque, self.turning + part * (self._turning - self.turning)

    @property
    def yield_speed(self) -> float:
        """The speed at which the learned load should give way at this sample, rad/s."""
        return self.turning - float(self.now[VELOCITY])

    @property
    def angle(self) -> float:
        """The angle of the gear at this sample, rad, from where it began."""
        return float(self.now[POSITION]) + float(self._angles[0])

    def _speed(self, seen: FloatArray, parts: FloatArray) -> float:
        theta = self._learned.load
        return float(theta[0] * seen[VELOCITY] + theta[1:] @ parts)


def mean_friction(start: float, end: float) -> float:
    """Return the mean of tanh along a straight line."""
    return _mean_tanh(start, end, math.exp(-2.0 * abs(start)))[0]
