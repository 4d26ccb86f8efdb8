"""Holds zero point and gain of ft against what else tells the spring's torque, while there is torque.

    spring   K d + D d', of the measured deflection d
    motor    m - J w' - b w, motor torque less momentum and damping of the gear

All signals pass one low-pass and one window of equal weights. Then means of sums add up: one that differs is
a zero point or a gain; and standard deviations do not depend on delays: one that differs is a gain. Friction
moves a mean only by how much more the gear goes one way than the other. That is told; what spring and motor
together contradict gravely is a fault at once (decision 314).
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rsea_ros.hardware.device import Spring, State
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.records.record import HUGE, is_measured

SMOOTH, MEMORY = 0.03, 0.5
"""s: time constants of low-pass and window. Above 5 Hz a delay of the velocity makes a false momentum."""
PAUSE, LASTING = 0.1, 0.5
"""s without torque that are a rest; s that a window has at least, and for which a contradiction lasts."""
UNEVEN = 0.5
"""Part of a deviation that a law which is not the same either way may make a mean of."""
LITTLE = 0.25
"""Of the spring: what an ft that goes with it is at least. No gain of a sound bench is less, so no low-pass
is needed to tell; delays are held by a hull of the last readings."""
TURNED = 0.6
"""Times the play: for an ft that goes the other way than the spring, by more than LITTLE; play does not."""
GRAVE, CYCLES, SIDED = 2.5, 2, 0.5
"""Times its doubts by which the spring contradicts ft gravely; readings running that are a fault; part of
that by which the motor may be off the spring that it sides with."""


@dataclass(frozen=True)
class Actuator:
    """What the rig says, SI: damping of the spring, inertia and drag of the gear.

    by_angle: whether the gear's angle is the spring's deflection, where that is not measured. bent, driven,
    risen, dragged: doubts, parts of the torques of spring and motor, of J w' and b w. play, friction: N m.
    creep: rad/s, below which the way is not known. late: s, by which readings may be of other instants.
    """

    damping: float
    inertia: float
    drag: float
    by_angle: bool
    bent: float
    driven: float
    risen: float
    dragged: float
    play: float
    friction: float
    creep: float
    late: float


class Signals(NamedTuple):
    """Torques in N m, and the way the gear goes: 1, -1, 0 where that is not known."""

    ft: float
    spring: float
    motor: float
    rise: float
    drag: float
    way: float


class Window(NamedTuple):
    """Readings so far, and the mean and mean square of their signals."""

    readings: int = 0
    mean: Signals = Signals(*[0.0] * 6)
    square: Signals = Signals(*[0.0] * 6)


class Witnesses:
    """Takes readings in. words: a lasting contradiction with its numbers, empty without one.

    One window follows the torque, over its pauses; another one each rest, at which ft has its zero. A zero
    that is another one than at the rest before is none: ft has been changed meanwhile. Until a rest has
    lasted, the zero is that of the readings since the first one without torque, if need be of the first one.
    """

    def __init__(self, spring: Spring, actuator: Actuator, period: float) -> None:
        self._spring, self._rig, self._period = spring, actuator, period
        self.restart()

    def restart(self) -> None:
        """Forget everything, also where ft is zero."""
        self._before: State | None = None
        self._zero, self._known, self._idle = math.nan, math.nan, math.inf
        self._begin()

    def _begin(self) -> None:
        """Begin anew."""
        self.words, self._off, self._grave = "", 0, 0
        self._low: Signals | None = None
        self._lately: deque[Signals] = deque(maxlen=1 + math.ceil(self._rig.late / self._period))
        self._noise = self._apart = 0.0
        self._rest, self._work = Window(), Window()

    def take(self, state: State, torque: float) -> DeviceFault | None:
        """Take a reading in; return the fault where both contradict ft gravely. torque: N m, commanded."""
        before, self._before = self._before, state
        time = 0.0 if before is None else 1e-9 * (state.stamp - before.stamp)
        if before is None or state.wrench is None or not time > 0.0:
            return None
        self._idle = 0 if torque != 0.0 else self._idle + 1
        signals = self._signals(before, state, state.wrench[self._spring.place], time)
        if math.isnan(signals.ft + signals.motor) or any(abs(x) > HUGE for x in signals):
            return None
        if self._low is None or math.isnan(signals.spring) != math.isnan(self._low.spring):
            self._begin()
        low = self._low or signals
        self._low = _nearer(low, signals, time / SMOOTH)
        self._lately.append(signals)
        if self._idle * self._period <= PAUSE:
            if math.isnan(self._zero):
                self._zero = self._low.ft - self._low.spring
            if self._rest.readings * self._period >= LASTING:
                self._known = self._zero
            self._rest = Window()
            self._work = self._followed(self._work, self._low)
            if self._work.readings * self._period >= LASTING:
                self._judge(self._work)
            live = (before.position, before.motor_torque) != (state.position, state.motor_torque)
            return self._gravely(self._low, low) if live else None  # else they are one witness, no two
        self._rest = self._followed(self._rest, self._low)
        if math.isnan(self._known) or self._rest.readings * self._period >= LASTING:
            zero = self._rest.mean.ft - self._rest.mean.spring
            self._zero = self._known if abs(zero - self._known) > self._rig.play else zero
        return None

    def _signals(self, before: State, state: State, felt: float, time: float) -> Signals:
        """Return what a reading says. felt: N m, as the sensor counts. time: since the one before, s."""
        rig, bend, rate = self._rig, state.deflection, (state.deflection - before.deflection) / time
        if rig.by_angle and not is_measured(bend):
            bend, rate = state.position, state.velocity
        rise, drag = rig.inertia * (state.velocity - before.velocity) / time, rig.drag * state.velocity
        return Signals(
            ft=self._spring.sign * felt,
            spring=math.nan if state.inferred else self._spring.stiffness * bend + rig.damping * rate,
            motor=state.motor_torque - rise - drag,
            rise=rise,
            drag=drag,
            way=math.copysign(abs(state.velocity) > rig.creep, state.velocity),
        )

    def _gravely(self, low: Signals, before: Signals) -> DeviceFault | None:
        """Return the fault of an ft that the spring contradicts gravely, and the motor sides with the spring.

        before: the low-pass that the reading is ahead of: what a delay makes at most, however far readings
        are apart. What ft and spring change against each other from one to the next tells what noise can.
        """
        now = self._lately[-1]
        ahead = abs(now.spring - before.spring), abs(now.motor - before.motor)
        bend, self._apart, apart = low.spring + self._zero, now.ft - now.spring, self._apart
        if math.isnan(bend):
            return None
        part = min(self._period / SMOOTH, 1.0)
        self._noise += part * (abs(self._apart - apart) - self._noise)
        late, hasty = (self._rig.late / SMOOTH * torque for torque in ahead)
        off, least = abs(low.ft - bend), min(abs(low.ft), abs(bend)) if low.ft * bend > 0.0 else 0.0
        most = GRAVE * max(self._rig.bent * least, self._rig.play)
        sided = abs(bend - low.motor) + hasty < SIDED * off
        if not (sided and off - late - self._noise > most):
            low, (off, most) = now, self._opposed(low)
            self._grave = self._grave if off - self._noise > most else -1
        self._grave += 1
        if self._grave < CYCLES:
            return None
        return DeviceFault("ft", off, most, "N m", f"off: {self._told(low)}")

    def _opposed(self, low: Signals) -> tuple[float, float]:
        """Return by how much ft goes against the spring and the motor sides with it, or 0, and a limit, N m.

        One that is late is among the last torques of the other, so each is held against all of them. An ft
        that has another zero changes as the spring does.
        """
        now, zero = self._lately[-1], self._zero
        spring, rise, bent = now.spring + zero, now.ft - low.ft, now.spring - low.spring
        turned = now.ft * spring < -LITTLE * spring**2 and rise * bent < -LITTLE * bent**2
        least = (TURNED if turned else GRAVE) * self._rig.play
        if abs(spring - now.ft) <= least:
            return 0.0, least
        bend = _nearest(now.ft, [x.spring + zero for x in self._lately])
        felt = _nearest(spring, [x.ft for x in self._lately])
        off, made = bend - now.ft, _nearest(now.ft, [x.motor for x in self._lately]) - now.ft
        against = now.ft * bend <= LITTLE * bend**2 and rise * bent <= LITTLE * bent**2
        sided = made * off >= SIDED * off**2
        return min(abs(off), abs(spring - felt)) if against and sided else 0.0, least

    def _followed(self, window: Window, low: Signals) -> Window:
        part = min(max(1.0 / (window.readings + 1), self._period / MEMORY), 1.0)
        squares = Signals._make([x * x for x in low])
        mean, square = _nearer(window.mean, low, part), _nearer(window.square, squares, part)
        return Window(window.readings + 1, mean, square)

    def _judge(self, window: Window) -> None:
        """Compare means, and standard deviations."""
        mean = window.mean
        swing = Signals(*(math.sqrt(max(q - m * m, 0.0)) for q, m in zip(window.square, mean, strict=True)))
        sizes = Signals(*(abs(m) + UNEVEN * s for m, s in zip(mean, swing, strict=True)))
        sizes = sizes._replace(rise=abs(mean.rise))
        zeroed = mean._replace(spring=mean.spring + self._zero)
        still = self._parts(zeroed, sizes, abs(mean.way) + 1.0 - window.square.way)
        moving = self._parts(swing, swing, 1.0)
        motor, spring = map(max, zip(still, moving, strict=True))
        self._off = self._off + 1 if max(motor, spring) > 1.0 else 0
        self.words = ""
        if self._off * self._period > LASTING:
            stands = max(still) > max(moving)
            told = self._told(mean) if stands else self._told(swing, " RMS")
            self.words = f"{told} contradict each other, expected them alike"

    def _told(self, x: Signals, of: str = "") -> str:
        """Return the torques in words. of: what of them, " RMS"."""
        told = f"ft {x.ft:.3g}, motor torque less momentum {x.motor:.3g}"
        if not math.isnan(x.spring):
            told += f", K times deflection {x.spring:.3g}"
            told += f" (ft is {self._zero:.3g} at rest)" if abs(self._zero) > self._rig.play else ""
        return f"{told} N·m{of}"

    def _parts(self, x: Signals, sizes: Signals, one_way: float) -> tuple[float, float]:
        """Return what motor and spring contradict ft by, as parts of what is allowed.

        one_way: part of the friction that counts. Where the motor sides with ft it is the spring that is
        not as stated.
        """
        rig, by_motor, by_spring = self._rig, abs(x.ft - x.motor), abs(x.ft - x.spring)
        motion = rig.risen * sizes.rise + rig.dragged * sizes.drag + rig.friction * one_way
        if math.isnan(by_spring) or by_motor < abs(x.spring - x.motor):
            by_spring = 0.0
        return (
            by_motor / (rig.play + rig.driven * sizes.motor + motion),
            by_spring / (rig.play + rig.bent * sizes.spring) if by_spring else 0.0,
        )


def _nearer(signals: Signals, to: Signals, part: float) -> Signals:
    """Return signals that have gone a part of the way, all of it at most, to others."""
    share = min(part, 1.0)
    return Signals._make([x + share * (y - x) for x, y in zip(signals, to, strict=True)])


def _nearest(x: float, several: Sequence[float]) -> float:
    """Return what is nearest to x between the least and the largest of several."""
    return min(max(x, min(several)), max(several))
