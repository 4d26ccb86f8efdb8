"""What readings say of the signs and sizes of ft, joint_states and motor torque: fits of two balances.

    m = s_T T + s_w (J w' + b w) + c sgn w + o            momentum of the gear, whatever the load does
    int m s_w dq > 0,   int (T - T_0) s_T s_w dq > 0      from rest: motor and passive load take power

m: motor torque, T: ft, q, w: angle and speed of the gear, c: friction, o: a bias, s: 1 where a sign is right.
A motor that somebody else moves makes the second line false; then the first alone counts.
"""

import math
from itertools import product

import numpy as np

from rsea_ros.control.controller import Measurement
from rsea_ros.control.link import spread
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.records.record import HUGE, FloatArray, is_measured

Signs = tuple[float, float]
SIGNS: tuple[Signs, ...] = tuple((s_t, s_w) for s_t, s_w in product((1.0, -1.0), repeat=2))
RIGHT = SIGNS[0]
MOVED = 0.1
"""Of a pulse: what torque or spring must move by to say anything."""
MEMORY = 0.5
"""s over which samples are fitted."""
ALIKE = 4.0
"""Samples that make one independent one: ripple, play and friction are no noise."""
SPREADS = (0.25, 0.25, 0.5, 5.0, 2.0)
"""Standard deviations of the factors of T, J w' and b w from 1 (1), of c and o from 0 (pulses)."""
POWER = 12.0
"""Half the difference of two sums of squares that a power of the wrong sign counts for."""
CLEAR, SIGMAS = 0.3, 3.0
"""Part of the motor's power that must go one way; standard deviations by which the load's must be known."""
BOTH = (1.6, 1.3)
"""Factors by which the angle between clamped ends, and surely the motor torque, contradict ft together."""
DOUBT = 0.5
"""Part of J w' + b w that nobody knows."""
GAIN = 2.5
"""Factor, up and down, by which ft may differ from what the rest of the bench says."""
CREEP = 2e-3
"""rad/s below which the sign of a speed is not known."""
SWAY, SETTLED, CALM = 0.3, 0.02, 0.1
"""s: of the mean from which the bench's unrest is measured, so that a load that swings at 0.5 Hz is none; of
that from which a pulse begins; of the unrest."""


class SignEvidence:
    """Takes readings in; pulses of torque begin and end between them. made: the last two motor torques, N m.

    unrest: RMS of what moves, N m. way, most: by how much the spring (by the gear's angle) and ft have moved
    in the pulse, N m. unseen: of that, what noise of the angle alone moves it by, N m. heard: s.
    """

    def __init__(self, rig: Rig, rate: float, pulse: float) -> None:
        """rate: Hz. pulse: N m, the size of a pulse of torque."""
        self._h, self._pulse = 1.0 / rate, pulse
        self._inertia, self._damping = rig["rotor.reflected_inertia"], rig["rotor.reflected_damping"]
        self._stiffness, self._clamped = rig["spring.stiffness"], rig.clamped == set(END_NAMES)
        noise = math.hypot(self._inertia * spread(rig, "velocity") * math.sqrt(2.0) * rate, spread(rig, "ft"))
        self.ft_noise = max(spread(rig, "ft"), 1e-3 * pulse)
        self.noise = math.hypot(noise, spread(rig, "motor_torque"))
        self._floor = max(MOVED * pulse, self.noise)
        self._creep, self._slip = max(CREEP, 4.0 * spread(rig, "velocity")), spread(rig, "velocity") * self._h
        self.unseen = 2.0 * SIGMAS * self._stiffness * spread(rig, "position")
        self._moved = max(MOVED * pulse, self.unseen)
        self._precision = 1.0 / (np.array([1.0, 1.0, 1.0, pulse, pulse]) * SPREADS) ** 2
        self.start()

    def start(self) -> None:
        """Forget everything."""
        self._before: Measurement | None = None
        self._moments = np.zeros((6, 6))
        self._mean = self._fast = math.nan
        self._square, self.heard = math.inf, 0.0
        self._past = dict.fromkeys(SIGNS, 0.0)
        self.made = (0.0, 0.0)
        self._pulsing = False

    @property
    def unrest(self) -> float:
        """RMS of what moves, N m."""
        return math.sqrt(self._square)

    def begin_pulse(self) -> None:
        """Count power and ways from here on."""
        assert self._before is not None
        self._pulsing, self._restless = True, self.unrest
        self._work, self.most, self.way, self._strongest = np.zeros(5), 0.0, 0.0, 0.0
        self._driven, self._slipped = 0.0, 0.0
        self._ft, self._from = self._fast, self._before.position

    def end_pulse(self) -> None:
        """Keep half of what the powers said for the next pulse."""
        self._past = {signs: 0.5 * power for signs, power in self.powers().items()}
        self._pulsing = False

    def hear(
        self, r: Measurement, sent: float, missed: int, *, keep: bool = True
    ) -> tuple[float, float] | None:
        """Take a reading; return T and J w' + b w, N m, means over the sample, None where they are not known.

        sent: N m, the motor torque where it is not measured. missed: samples that were lost before. keep:
        whether it joins the fit.
        """
        if not r.is_whole:
            return None
        before, self._before = self._before, r
        made = r.motor_torque if is_measured(r.motor_torque, HUGE) else sent
        self.made = (made if before is None else self.made[1], made)
        if before is None:
            return None
        ft, turn = 0.5 * (r.ft + before.ft), r.position - before.position
        speed = 0.5 * (r.velocity + before.velocity)
        if self._pulsing:
            taken = (ft - self._ft) * turn
            self._work += np.array([made * turn, abs(made * turn), taken, turn * turn, abs(turn)])
            self.most, self._strongest = max(self.most, abs(ft - self._ft)), max(self._strongest, abs(made))
            self._driven += speed * self._h * (1 + missed)
            self._slipped = math.hypot(self._slipped, self._slip * (1 + missed))
            self.way = max(self.way, self._stiffness * abs(r.position - self._from))
        self._settle(ft, speed)
        if missed:
            return None
        rise = self._inertia * (r.velocity - before.velocity) / self._h
        if keep and abs(speed) > self._creep:
            row = (ft, rise, self._damping * speed, math.copysign(1.0, speed), 1.0, made)
            self._moments += np.outer(row, row)
        return ft, rise + self._damping * speed

    def _settle(self, ft: float, speed: float) -> None:
        """Follow the unrest."""
        if math.isnan(self._mean):
            self._mean = self._fast = ft
        self._mean += self._h / SWAY * (ft - self._mean)
        self._fast += self._h / SETTLED * (ft - self._fast)
        square = (ft - self._mean) ** 2 + (self._damping * speed) ** 2
        before = square if math.isinf(self._square) else self._square
        self._square = before + self._h / CALM * (square - before)
        self.heard += self._h
        self._moments *= 1.0 - self._h / MEMORY

    def powers(self) -> dict[Signs, float]:
        """Return what the powers of this pulse and the last ones say against each pair of signs."""
        return {signs: self._past[signs] + self._wrong_power(*signs) for signs in SIGNS}

    def turned(self) -> str:
        """Return in words that position and velocity went opposite ways in this pulse; empty where not."""
        gone = 0.0 if self._before is None else self._before.position - self._from
        if self._stiffness * abs(gone) <= self._moved:
            return ""
        against = math.copysign(self._driven, -self._driven * gone)
        opposite = against > 0.5 * abs(gone) + SIGMAS * self._slipped
        return "position and velocity of joint_states go opposite ways" if opposite else ""

    def wrong_size(self) -> str:
        """Return in words which quantity is of the wrong size; empty where none is known to be.

        A light load hides the size of ft: that is no fault.
        """
        if self.most > GAIN * self.way + self._moved + 2.0 * SIGMAS * self._restless:
            return f"joint_states moved by {self.way:.3g} N·m of spring, ft by {self.most:.3g} N·m"
        ft, doubt = self._size()
        low, high = ft - doubt, ft + doubt
        if low > GAIN or 0.0 < low < high < 1.0 / GAIN:
            return f"ft is {1.0 / ft:.2g} times the torque by motor torque and motion"
        beyond = self._moved + 2.0 * SIGMAS * self._restless
        half = low > BOTH[1] and self.way > BOTH[0] * self.most + beyond
        double = 0.0 < high < 1.0 / BOTH[1] and self.most > BOTH[0] * self.way + beyond
        felt, made = min(self.way, self.most), self._strongest
        if self._clamped and felt > GAIN * made + beyond:
            return f"ft and K times the gear's angle moved by {felt:.3g} N·m at a motor torque of {made:.3g}"
        if self._clamped and (half or double):
            spring = f"K times the gear's angle by {self.way:.3g} N·m"
            return f"ft moved by {self.most:.3g}, {spring}, and ft is {1.0 / ft:.2g} times the motor's torque"
        return ""

    def size_is_known(self) -> bool:
        """Return whether ft is known to be of the right size."""
        ft, doubt = self._size()
        return ft - doubt > 1.0 / GAIN and ft + doubt < GAIN

    def _size(self) -> tuple[float, float]:
        """Return the factor a in m - (J w' + b w) = a T + c sgn w + o, and its doubt: noise, and that of J
        and b."""
        m = self._moments
        count = max(m[4, 4], 1.0)
        m = m - m[:, 3:5] @ np.linalg.pinv(m[3:5, 3:5], rcond=1e-3) @ m[3:5, :]
        t, t_motion, t_made = m[0, 0], m[0, 1] + m[0, 2], m[0, 5]
        motion = m[1, 1] + 2.0 * m[1, 2] + m[2, 2]
        free = count - 3.0 * ALIKE  # a fit of three to as many independent samples leaves nothing
        if t <= 0.0 or free <= 0.0:
            return 1.0, math.inf
        factor = float((t_made - t_motion) / t)
        left = max(m[5, 5] - 2.0 * (m[1, 5] + m[2, 5]) + motion - factor * (t_made - t_motion), 0.0)
        noise = 3.0 * math.sqrt(ALIKE * max(left / free, self.noise**2))
        return factor, (noise + DOUBT * math.sqrt(max(motion, 0.0))) / math.sqrt(t)

    def _information(self) -> FloatArray:
        """Return the moments over the variance of what the best fit leaves, for ALIKE samples each."""
        m, count = self._moments, max(self._moments[4, 4], 1.0)
        best = np.linalg.lstsq(m[:5, :5], m[:5, 5], rcond=1e-9)[0]
        left = float(m[5, 5] - best @ m[:5, 5]) / count
        information: FloatArray = m / (ALIKE * max(self._floor**2, left))
        return information

    def _fit(self, m: FloatArray, s_t: float, s_w: float) -> tuple[FloatArray, float]:
        """Return the factors of the momentum's parts with signs, and half of the squares that they leave."""
        x = np.array([s_t, s_w, s_w, 0.0, 0.0])
        best = np.linalg.solve(m[:5, :5] + np.diag(self._precision), m[:5, 5] + self._precision * x)
        left = m[5, 5] - 2.0 * best @ m[:5, 5] + best @ m[:5, :5] @ best
        return best, 0.5 * float(left + self._precision @ (best - x) ** 2)

    def misfits(self) -> dict[Signs, float]:
        """Return half of what is left of the momentum with each pair of signs, over its variance."""
        m = self._information()
        return {signs: self._fit(m, *signs)[1] for signs in SIGNS}

    def friction(self) -> float:
        """Return the friction and bias of the fit, N m."""
        best, _ = self._fit(self._information(), *RIGHT)
        return float(abs(best[3]) + abs(best[4]))

    def _wrong_power(self, s_t: float, s_w: float) -> float:
        """Return POWER for each power from rest that is of the wrong sign."""
        made, whole, taken, square, way = self._work.tolist()
        cost, stored = 0.0, 0.5 * self._ft**2 / self._stiffness
        pushed = max(CLEAR * whole, stored, SIGMAS * self._restless * way)
        if self.way > self._moved and abs(made) > pushed:
            cost += POWER * (s_w * made < 0.0)
        if abs(taken) > SIGMAS * (self.ft_noise * math.sqrt(square) + self._restless * way):
            cost += POWER * (s_t * s_w * taken < 0.0)
        return cost


SURE = 8.0
CYCLES, LOST = 2, 12
"""Samples that a sign has turned for at least; after which what was before says nothing."""
UNDONE = 0.4
"""Of a step: what its other sign may leave of it."""
USUAL = 2.0
"""s over which steps are usual ones."""
JUMP, JUMPED, LEAST, RECENT = 0.35, 8.0, 0.35, 0.25
"""Of the largest |ft| of the last RECENT s, standard deviations of a usual step, and of a pulse: what a step
of ft beyond the spring's is at most on a sound bench, modes and play among them (decision 332)."""
BELIEVED, STIFF = 0.005, 1.3
"""s for which a jump is held for a disturbance; factor by which the spring may be stiffer than stated."""


class SignChange:
    """Finds the sample in which ft or joint_states turned round, from two on, whatever the load does.

        jump    a step of ft beyond a clamped spring that has not moved: no torque follows it
        ft      a step that its other sign undoes, beside a spring that has not moved; where its other side
                may move, also a momentum that is off by twice ft from there on
        angle   a step beside its speed that its other sign undoes

    Each is a test of two hypotheses on Gaussian noise, half the difference of two squares over the variance
    (Wald, Sequential Analysis, 1947), e^SURE to 1. The variance is what a sample changes anyway on this
    bench: of ft, of the angle, of the momentum.
    """

    def __init__(self, rig: Rig, rate: float, noise: tuple[float, float], pulse: float) -> None:
        """rate: Hz. noise: standard deviations of ft and of the momentum, N m. pulse: N m."""
        self._h, self._floor = 1.0 / rate, LEAST * pulse
        self._patience = max(CYCLES, round(BELIEVED * rate))
        self._clamped, stiffness = rig.clamped == set(END_NAMES), rig["spring.stiffness"]
        self._stiffness, self._damping = stiffness, rig["spring.damping"]
        stops = [effect.parameters["stiffness"] for effect in rig.effects if effect.name == "hard_stop"]
        self._hardest = sum(stops, STIFF * stiffness)
        turn = spread(rig, "velocity") / rate
        angle = math.hypot(spread(rig, "position"), turn, noise[0] / stiffness / 10.0)
        self._least = [noise[0] ** 2, angle**2, noise[1] ** 2]
        self.start()

    def start(self) -> None:
        """Forget everything."""
        self._before: tuple[Measurement, float] | None = None
        self._usual, self._last, self._strongest = [*self._least], [0.0] * 3, 0.0
        self._forget()

    def _forget(self) -> None:
        self._since = self._turned = self._counted = self._jumps = 0
        self._off = self._due = 0.0

    def jump(self, r: Measurement, missed: int) -> float:
        """Return the step of ft that a clamped spring has not followed, N m; 0 where ft may be believed."""
        since = self._since + 1 + missed
        if not self._clamped or self._before is None or not r.is_whole or since > LOST:
            return 0.0
        before, _ = self._before
        late = self._h * (before.velocity * before.ft_age - r.velocity * r.ft_age)  # ft of another instant
        drag = STIFF * self._damping * (r.velocity - before.velocity)
        turns = r.position - before.position, r.position - before.position + late
        step = min((_beyond(r.ft - before.ft, self._hardest * turn + drag) for turn in turns), key=abs)
        usual = JUMPED * since * math.sqrt(self._usual[0])
        return step if abs(step) > max(self._floor, JUMP * self._strongest, usual) else 0.0

    def take(self, r: Measurement, rest: float | None, missed: int, jump: float) -> str:
        """Take a reading in; return what has turned round or jumped, in words, empty if nothing surely has.

        rest: N m, the momentum that nothing explains, None where it is not known. missed: samples lost.
        jump: of this reading, see there.
        """
        self._since += 1 + missed
        if not r.is_whole:
            return ""
        if self._before is None:
            return self._follow(r, rest)
        before, rest_before = self._before
        most, time = self._since**2, 0.5 * self._since * self._h
        turn = r.position - before.position - (0.0 if self._clamped else 2.0 * time * before.velocity)
        bent = self._stiffness * turn + self._damping * (r.velocity - before.velocity)
        steps = [
            _beyond(r.ft - before.ft, bent),
            r.position - before.position - time * (r.velocity + before.velocity),
        ]
        undone = [
            _beyond(-r.ft - before.ft, bent),
            -r.position - before.position - time * (before.velocity - r.velocity),
        ]
        off = 0.0 if rest is None else rest - rest_before
        for k, name in ((1, "joint_states"), (0, "ft")):
            if abs(undone[k]) > UNDONE * abs(steps[k]) or self._since > LOST:
                continue
            if self._odds(k, steps[k], undone[k], most) > SURE:
                self._turned += 1
                if rest is not None:
                    self._off += off
                    self._due -= (2.0 if self._turned > 1 else 1.0) * r.ft
                    self._counted += 1
                felt = self._clamped or self._odds(2, self._off, self._off - self._due, self._counted) > SURE
                sure = self._turned >= CYCLES and (k == 1 or felt)
                return f"{name} has changed its sign" if sure else ""
        if jump:
            self._jumps += 1
            return f"ft jumped by {jump:.3g} N·m beside the spring" if self._jumps >= self._patience else ""
        if self._since == 1 and rest is not None:
            self._last = [step**2 for step in (*steps, off)]
            part = self._h / USUAL
            self._usual = [
                max(least, usual + part * (last - usual))
                for least, usual, last in zip(self._least, self._usual, self._last, strict=True)
            ]
        return self._follow(r, rest)

    def _odds(self, k: int, step: float, undone: float, times: float) -> float:
        """Return the logarithm of how much better the other sign explains a step. times: its variance's."""
        return 0.5 * (step**2 - undone**2) / (max(times, 1) * max(self._usual[k], self._last[k]))

    def _follow(self, r: Measurement, rest: float | None) -> str:
        """Compare the next samples with this one."""
        self._strongest = max(abs(r.ft), self._strongest * (1.0 - self._h / RECENT))
        if rest is None:
            self._before = None if self._before is None else (r, self._before[1])
        else:
            self._before = r, rest
        self._forget()
        return ""


def _beyond(step: float, reach: float) -> float:
    """Return by how much a step is beyond what lies between 0 and reach."""
    return step - min(max(step, min(reach, 0.0)), max(reach, 0.0))
