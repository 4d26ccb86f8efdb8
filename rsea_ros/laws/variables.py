"""Variables of a law: signals of the machine, memory of their past, and how they show in the channels.

The motion is the measured one, smoothed: the simulation plus the response to the missing torque.

Each is one small function of the state and the newest value; the generated files call the same.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from rsea_ros.compiler import njit
from rsea_ros.diagnosis.data_split import blocks_of, set_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.missing_torque import PORTS, Injector, MissingTorque, Place, missing_torque
from rsea_ros.identification.problem import Case, Problem, residual_of
from rsea_ros.identification.solver import jacobian
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.terms import Term
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.inverse import Motion, smooth
from rsea_ros.model.rig import Rig
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import FloatArray, IntArray

RING = 512
"""Values that a delay keeps: a quarter of a second at the usual step."""


@njit(inline="always")
def lagged(before, value, step, time_constant):  # type: ignore[no-untyped-def]
    """Return the lag of a signal after a step (s) in which it had a value."""
    return before + (value - before) * -math.expm1(-step / time_constant)


@njit(inline="always")
def played(before, value, half):  # type: ignore[no-untyped-def]
    """Return the position dragged behind a signal with play on either side (Krasnoselskii's play)."""
    return min(max(before, value - half), value + half)


@njit(inline="always")
def bent(before, way, angle):  # type: ignore[no-untyped-def]
    """Return Dahl's bristle after a way (rad), within -1 and 1: z' = (1 - sign(way) z) / angle."""
    side = math.copysign(1.0, way)
    return side + (before - side) * math.exp(-abs(way) / angle)


@njit(inline="always")
def rung(x, first, value, step, frequency, damping_ratio):  # type: ignore[no-untyped-def]
    """Return y of y'' / w^2 + 2 damping_ratio y' / w + y = value after a step.

    y and y' are x[first] and x[first + 1]. frequency: Hz, w = 2 pi frequency. Exact for
    a value that is held over the step.
    """
    w = 2.0 * math.pi * frequency
    decay, turn = damping_ratio * w, w * math.sqrt(1.0 - damping_ratio * damping_ratio)
    u, v = x[first] - value, x[first + 1]
    e, c, n = math.exp(-decay * step), math.cos(turn * step), math.sin(turn * step) / turn
    x[first] = value + e * (u * (c + decay * n) + v * n)
    x[first + 1] = e * (v * (c - decay * n) - u * w * w * n)
    return x[first]


@njit(cache=True)
def rings(values, step, frequency, damping_ratio):  # type: ignore[no-untyped-def]
    """Return the answer of a mode along a signal."""
    out, x = np.empty(len(values)), np.zeros(2)
    x[0] = values[0]
    for k in range(len(values)):
        out[k] = rung(x, 0, values[k], step, frequency, damping_ratio)
    return out


@njit(cache=True)
def lags(values, step, time_constant):  # type: ignore[no-untyped-def]
    """Return the lag of a signal at the middle of each step, where the step calls it."""
    out, now = np.empty(len(values)), 0.0
    for k in range(len(values)):
        now = lagged(now, values[k], step, time_constant)
        out[k] = now
    return out


@njit(cache=True)
def plays(values, half):  # type: ignore[no-untyped-def]
    """Return the play operator along a signal."""
    out, now = np.empty(len(values)), values[0]
    for k in range(len(values)):
        now = played(now, values[k], half)
        out[k] = now
    return out


@njit(cache=True)
def bends(values, angle):  # type: ignore[no-untyped-def]
    """Return Dahl's bristle along an angle."""
    out, now, last = np.empty(len(values)), 0.0, values[0]
    for k in range(len(values)):
        now = bent(now, values[k] - last, angle)
        out[k], last = now, values[k]
    return out


def remember(memory: str, values: FloatArray, step: float, shape: float, constant: float = 0.0) -> FloatArray:
    """Return the memory of a signal along the steps; for `heat` of its square. constant: damping ratio."""
    if memory == "ring":
        return np.asarray(rings(values, step, shape, constant))
    if memory == "delay":
        steps = shape / step
        at = np.arange(len(values)) - steps
        return np.asarray(
            np.interp(at, np.arange(-1, len(values)), np.concatenate([[0.0], values]), left=0.0)
        )
    if memory == "play":
        return np.asarray(plays(values, shape))
    if memory == "dahl":
        return np.asarray(bends(values, shape))
    return np.asarray(lags(values * values if memory == "heat" else values, step, shape))


@njit(inline="always")
def from_ring(x, first, value, steps):  # type: ignore[no-untyped-def]
    """Put a value into a ring of states from x[first] on, and return the delayed one."""
    back = min(max(steps, 0.0), RING - 2.0)
    whole, now = int(back), int(x[first])
    x[first + 1 + now] = value
    newer, older = x[first + 1 + (now - whole) % RING], x[first + 1 + (now - whole - 1) % RING]
    x[first] = (now + 1) % RING
    return newer + (back - whole) * (older - newer)


@dataclass(frozen=True)
class Variables:
    """Variables by their letters (terms.py) at instants `step` s apart, SI, shape (n,) each."""

    step: float
    letters: Mapping[str, FloatArray]

    def values(self, term: Term, shape: float) -> FloatArray:
        """Return a term along the record, for a coefficient of 1."""
        letters = dict(self.letters)
        if term.memory:
            letters["m"] = remember(term.memory, letters[term.remembers], self.step, shape, term.constant)
        return term.values(letters, shape)

    def shapes(self, term: Term) -> tuple[float, ...]:
        """Return the shapes to be tried of a term, SI; 0 for one that has none.

        Shares of how large the variable gets, but for its rarest values.
        """
        if not term.shape:
            return (0.0,)
        size = float(np.quantile(np.abs(self.letters[term.over]), 0.995)) if term.over else 1.0
        return tuple(share * size for share in term.shapes)


def variables_of(injector: Injector, missing: MissingTorque) -> Variables:
    """Return the variables of a simulated record at the middle of each step."""
    rig, drive = injector.rig, injector.drive
    at = injector.middles
    base = 0.5 * (injector.base[1:] + injector.base[:-1])
    out = {n: base[:, k] for k, n in enumerate(OUTPUTS)}
    for n, answer in missing.answers.items():
        out[n] = out[n] + CubicSpline(missing.t, answer)(np.clip(at, 0.0, missing.t[-1]))
    command = base[:, OUTPUTS.index("motor_torque")] if rig.loop else drive.command
    return Variables(drive.step, _letters(rig, at, out["velocity"], out["position"], out["deflection"],
                                          out["ft"], command))  # fmt: skip


def variables_along(rig: Rig, motion: Motion) -> Variables:
    """Return the variables of a measured motion of a drive without a spring; its load is what it drives."""
    gravity = rig["spring_end.gravity"] * np.sin(motion.q + rig["spring_end.gravity_angle"])
    load = gravity + rig["spring_end.inertia"] * motion.a
    t, nothing = motion.t - motion.t[0], np.zeros(len(motion.t))
    return Variables(float(motion.t[1] - motion.t[0]),
                     _letters(rig, t, motion.v, motion.q, nothing, load, motion.torque))  # fmt: skip


def _letters(rig: Rig, t: FloatArray, w: FloatArray, q: FloatArray, d: FloatArray, load: FloatArray,
             u: FloatArray) -> dict[str, FloatArray]:  # fmt: skip
    h = d - q if rig.end_is_free("housing_end") else q - d
    letters = {"w": w, "q": q, "h": h, "theta": train_ratio(rig) * q, "d": d, "T": load, "u": u, "t": t,
               "share": t / max(float(t[-1]), 1e-9)}  # fmt: skip
    return {n: np.ascontiguousarray(v) for n, v in letters.items()}


GROUPS = 8
"""Groups of neighbouring blocks of each set, between which the spread of a gain is seen."""


@dataclass(frozen=True)
class CaseModel:
    """One case with its base model: missing torque, variables of a law, and the responses to a torque.

    residual: measured less simulated by channel, zero where masked.
    """

    case: Case
    residual: Mapping[str, FloatArray]
    missing: MissingTorque
    variables: Variables
    injector: Injector | None

    @property
    def places(self) -> tuple[Place, ...]:
        """Where a law may act on this machine."""
        if self.injector is None:
            return ("gear",)
        rig, measured = self.injector.rig, self.case.measured
        can = {
            "gear": True,
            "motor": rig.loop is None,
            "command": rig.loop is None and "motor_torque" in measured,
            "spring": not rig.rigid_spring and rig.ft_end == "spring_end",
            "load": len(rig.clamped) == 1 and rig.loop is None,
            "ft": "ft" in measured,
            "encoder": "position" in measured and not rig.rigid_spring,
        }
        return tuple(place for place in PORTS if can[place])

    def answers(self, values: FloatArray, place: Place) -> dict[str, FloatArray]:
        """Return the response of each measured channel to values along the steps, acting at a place."""
        case = self.case
        if self.injector is None:
            nothing = {n: np.zeros(len(t)) for n, t in case.t.items()}
            return {**nothing, "motor_torque": -smooth(values, self.variables.step)}
        if place not in ("ft", "encoder"):
            return self.injector.answers(values, place)
        made = {n: np.zeros(len(t)) for n, t in case.t.items()}
        at = self.injector.drive.start + self.injector.middles
        if place == "ft":
            made["ft"] = np.interp(case.t["ft"], at, values)
        else:
            made["position"] = np.interp(case.t["position"], at, values)
            if "velocity" in case.t:
                made["velocity"] = np.interp(case.t["velocity"], at, np.gradient(values, self.variables.step))
        return made


def case_model(
    problem: Problem, theta: FloatArray, case: Case, outputs: Mapping[str, FloatArray], place: Place = "gear"
) -> CaseModel:
    """Return a case with its base model at theta.

    outputs: simulated channels. place: of the missing torque.
    """
    rig, clocks = apply(problem.rig, problem.unknowns, theta)
    rig = rig.under(case.source)
    residual = {n: residual_of(case, outputs, n) for n in case.measured}
    if isinstance(case.drive, Motion):
        t = case.drive.t - case.drive.t[0]
        torque = -residual["motor_torque"]
        missing = MissingTorque(t, torque, case.noise["motor_torque"], {})
        return CaseModel(case, residual, missing, variables_along(rig, case.drive), None)
    since = {n: t - case.start for n, t in case.t.items()}
    sampled = {n: t + clocks.later(n, since[n]) + rig.clock(n, since[n]) for n, t in case.t.items()}
    injector = Injector(rig, case.drive, sampled)
    channel = "position" if "position" in case.t else next(iter(case.t))
    period = float(np.median(np.diff(case.t[channel])))
    motion = missing_torque(case, residual, injector, period)
    missing = motion if place == "gear" else missing_torque(case, residual, injector, period, place)
    return CaseModel(case, residual, missing, variables_of(injector, motion), injector)


@dataclass(frozen=True)
class ResidualRows:
    """All residuals of a base model, measured less simulated over the noise, shape (m,), and how they group.

    group: set of the block times GROUPS plus a number. channel: number of the channel in `channels`.
    """

    residual: FloatArray
    nominal: FloatArray
    prior: FloatArray
    group: IntArray
    channel: IntArray
    channels: tuple[str, ...]
    masks: tuple[tuple[int, str], ...]
    problem: Problem

    def column(self, answers: Sequence[Mapping[str, FloatArray]]) -> FloatArray:
        """Return answers, one mapping a case, as a column of these rows."""
        cases = self.problem.cases
        return np.concatenate([(answers[i][n] / cases[i].noise[n])[cases[i].mask[n]] for i, n in self.masks])

    @cached_property
    def parts(self) -> dict[tuple[int, int], IntArray]:
        """Rows of each group and channel."""
        key = self.group * len(self.channels) + self.channel
        order = np.argsort(key, kind="stable")
        cuts = np.flatnonzero(np.diff(key[order])) + 1
        pieces = np.split(order, cuts)
        return {(int(self.group[p[0]]), int(self.channel[p[0]])): p for p in pieces}


def rows_of(problem: Problem, theta: FloatArray) -> ResidualRows:
    """Return the rows of a base model. problem: on all samples of its cases."""
    residual = problem.residual(theta)
    masks = tuple((i, n) for i, case in enumerate(problem.cases) for n in problem.present(case))
    groups = []
    for i, n in masks:
        case = problem.cases[i]
        block = blocks_of(case, n, DEFAULT.blocks)[case.mask[n]]
        count = max(int(block.max(initial=0)) + 1, 1)
        groups.append(set_of(block) * GROUPS + np.minimum(block * GROUPS // count, GROUPS - 1))
    sizes = [int(np.count_nonzero(problem.cases[i].mask[n])) for i, n in masks]
    names = tuple(dict.fromkeys(n for _, n in masks))
    which = np.concatenate([np.full(k, names.index(n)) for k, (_, n) in zip(sizes, masks, strict=True)])
    return ResidualRows(
        residual=-residual, nominal=jacobian(problem, theta, residual),
        prior=np.array([1.0 / u.reach for u in problem.unknowns]), group=np.concatenate(groups),
        channel=which, channels=names, masks=masks, problem=problem,
    )
