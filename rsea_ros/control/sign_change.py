"""Finds the sample in which ft or joint_states turned round, from two samples on, whatever the load does.

    jump    a step of ft beyond a clamped spring that has not moved: no torque follows it
    ft      a step that its other sign undoes, beside a spring that has not moved; where its other side may
            move, also a momentum (sign_evidence.py) that is off by twice ft from there on
    angle   a step beside its speed that its other sign undoes

Each is a test of two hypotheses on Gaussian noise, half the difference of two squares over the variance
(Wald, Sequential Analysis, 1947), e^SURE to 1. The variance is what a sample changes anyway on this bench.
"""

import math

from rsea_ros.control.controller import Measurement
from rsea_ros.control.spring_encoder import spread
from rsea_ros.model.rig import END_NAMES, Rig

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
    """Takes samples in, and keeps what they change anyway: of ft, of the angle, of the momentum."""

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
