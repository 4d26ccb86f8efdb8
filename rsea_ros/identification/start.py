"""Where a fit begins, and where a load does behind gaps: responses, joint starts, and the machine's scale.

An output error of hundreds of times the noise has many minima; the logarithm of a response has hardly any,

    r = ln(G_model / G_measured) / w,   w^2 = (sd / |G|)^2 + 0.05^2

so a rig that is far off still converges. The result only starts the fit and decides nothing.

u = J a + b v + F sign(v) + c_s sin q + c_c cos q + T_0,   m g l = |(c_s, c_c)|, its angle atan2(c_c, c_s)

u is the loop's law on the measured motion (its integral aside), q filtered both ways and differentiated (the
inverse model; Gautier, Janot et al.). Gravity's angle has two minima in an output error: this finds the side.

Behind lost commands the sensors show where the gear is and how fast; a load that moves is elsewhere by all
that it did meanwhile, which no sensor shows at once. Position, speed, and the spring's torque or deflection
with its rate are linear unknowns of the samples until the next gap.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.effects.parameter import STIFFNESS, TORQUE, Scale, scale_to
from rsea_ros.errors import RseaError
from rsea_ros.identification.frequency_response import model_response
from rsea_ros.identification.problem import APART, OFF, Case, Problem, change_of_starts, shown_by_starts
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.identification.solver import Map, descend, serial, solve
from rsea_ros.identification.unknowns import Clocks, apply, start_vector, unknowns_of_rig
from rsea_ros.model.drive import Drive, LoadStart, SpringStart
from rsea_ros.model.equations import mechanics
from rsea_ros.model.inverse import FEWEST, smooth
from rsea_ros.model.position_loop import loop_parameters
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

_LINES = 60
"""Of each response, evenly spread on a logarithmic scale."""
_COHERENT = 0.5
_MODEL_ERROR = 0.05
_DIFFERENCE = 1e-4


def start_from(responses: Sequence[FrequencyResponse], rig: Rig) -> Rig:
    """Return the rig with free values that bring its linear responses near the measured ones."""
    unknowns, chosen = unknowns_of_rig(rig), [r for r in map(_choose_lines, responses) if len(r.frequency)]
    if not (unknowns and chosen):
        return rig
    prior = np.diag([u.reach**-2.0 for u in unknowns])

    def residual(theta: FloatArray) -> FloatArray:
        moved, _ = apply(rig, unknowns, theta)
        return np.concatenate([_misfit(r, moved) for r in chosen])

    def slope(theta: FloatArray, at: FloatArray) -> FloatArray:
        steps = _DIFFERENCE * np.eye(len(theta))
        return np.column_stack([(residual(theta + s) - at) / _DIFFERENCE for s in steps])

    return apply(rig, unknowns, descend(residual, slope, start_vector(unknowns), prior).theta)[0]


def _choose_lines(response: FrequencyResponse) -> FrequencyResponse:
    """Return the lines that count, few enough to be quick."""
    good = np.flatnonzero(
        (response.coherence > _COHERENT) & np.isfinite(response.sd) & (response.frequency > 0.0)
    )
    if len(good) > _LINES:
        wanted = np.geomspace(response.frequency[good[0]], response.frequency[good[-1]], _LINES)
        good = good[np.unique(np.searchsorted(response.frequency[good], wanted).clip(0, len(good) - 1))]
    chosen = {n: getattr(response, n)[good] for n in ("frequency", "response", "coherence", "sd")}
    return replace(response, **chosen, noise=None, distortion=None)


def _misfit(measured: FrequencyResponse, rig: Rig) -> FloatArray:
    quotient = np.log(model_response(rig, measured.output, measured.frequency) / measured.response)
    weight = np.hypot(measured.sd / np.abs(measured.response), _MODEL_ERROR)
    return np.concatenate([quotient.real / weight, quotient.imag / weight])


_SLOW = 0.05
"""Of the RMS speed: below it the sign of the speed is not determined."""
_TURNS = 2.0
"""rad of travel from which gravity is distinguished from a constant torque."""
_LEAST = 1e-3
"""Of its stated value: an inertia or damping that comes out smaller begins there."""
GRAVITY, ANGLE = "spring_end.gravity", "spring_end.gravity_angle"
INERTIA, DAMPING = "rotor.reflected_inertia", "rotor.reflected_damping"


def joint_start(record: Record, rig: Rig) -> Rig:
    """Return the rig with its free values from the regression; unchanged where that is impossible.

    record: with the targets as its command.
    """
    try:
        inertia, damping, _, sine, cosine, _ = _regression(record, rig)
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return rig
    load = rig["spring_end.inertia"] + rig["chassis.inertia"]
    coefficients = {
        INERTIA: max(inertia - load, _LEAST * rig[INERTIA]),
        DAMPING: max(damping, _LEAST * rig[DAMPING]),
        GRAVITY: math.hypot(sine, cosine),
        ANGLE: math.atan2(cosine, sine),
    }
    free = rig.free()
    if GRAVITY in free and ANGLE not in free:
        coefficients[GRAVITY] = max(sine, 0.0)
    return rig.with_values({n: v for n, v in coefficients.items() if n in free and math.isfinite(v)})


def _regression(record: Record, rig: Rig) -> FloatArray:
    """Return J, b, F, c_s, c_c, T_0. Raises ValueError for a record too short."""
    position = record["position"]
    if len(position) < FEWEST:
        raise ValueError("too few samples")
    step = 1.0 / position.rate
    t = np.arange(position.t[0], position.t[-1], step)
    q = smooth(np.interp(t, position.t, position.y), step)
    v = smooth(np.gradient(q, step), step)
    a = smooth(np.gradient(v, step), step)
    sign = np.tanh(v / max(_SLOW * float(np.sqrt(np.mean(v**2))), 1e-300))
    terms = np.column_stack([a, v, sign, np.sin(q), np.cos(q), np.ones(len(q))])
    keep = terms if np.ptp(q) > _TURNS else terms[:, :5]
    solved = np.linalg.lstsq(keep, _loop_torque(record, rig, t, q, v), rcond=None)[0]
    return np.concatenate([solved, np.zeros(6 - len(solved))])


def _loop_torque(record: Record, rig: Rig, t: FloatArray, q: FloatArray, v: FloatArray) -> FloatArray:
    """Return the torque that the loop makes along a motion, without its integral."""
    target = smooth(record["command"].held(t), float(t[1] - t[0]))
    _, position, _, velocity, *_ = loop_parameters(rig)
    if rig.loop != "cascade":
        return position * (target - q) - velocity * v
    return velocity * (position * (target - q) - v)


LARGEST = 0.999
"""Quantile that is taken for the largest value: a few samples may be outliers."""
_LAG = 0.02
"""s over which the measured angle is differenced for a speed: over one sample it were the encoder's step."""


def scale_of(cases: Sequence[Case], rig: Rig) -> Scale:
    """Return how a machine and its records compare with the machine of the catalogue."""
    torque = max((torque_size(case, rig.under(case.source)) for case in cases), default=0.0)
    stiffness = STIFFNESS * torque / TORQUE if rig.rigid_spring else rig["spring.stiffness"]
    speed = max((_speed(case) for case in cases), default=0.0)
    inertia = rig["rotor.reflected_inertia"]
    return scale_to(torque, stiffness, inertia, speed, max((_period(case) for case in cases), default=0.0))


def torque_size(case: Case, rig: Rig) -> float:
    """Return the largest torque of a run, N m: commanded, or measured in the motor or by the F/T sensor.

    Of a position loop: measured in the motor, otherwise computed from its errors. 0 where unknown.
    """
    if rig.loop is None:
        shown = [_largest(case, n) for n in ("motor_torque", "ft") if n in case.measured]
        commanded = [_quantile(case.drive.command)] if isinstance(case.drive, Drive) else []
        return max([*commanded, *shown], default=0.0)
    if "motor_torque" in case.measured:
        return _largest(case, "motor_torque")
    return _torque_of_errors(case, rig)


def _torque_of_errors(case: Case, rig: Rig) -> float:
    """Return the largest torque of a position loop by its errors, N m; 0 without a position."""
    if "position" not in case.measured or not isinstance(case.drive, Drive):
        return 0.0
    keep = case.mask["position"]
    error = case.drive.command_at(case.t["position"][keep]) - case.measured["position"][keep]
    _, position, _, velocity, *_ = loop_parameters(rig)
    gain = position if rig.loop != "cascade" else position * velocity
    return gain * _quantile(error)


def _speed(case: Case) -> float:
    """Return the largest speed of a run, rad/s; 0 where neither speed nor angle was measured."""
    if not isinstance(case.drive, Drive):
        return _quantile(case.drive.v)
    if "velocity" in case.measured:
        return _largest(case, "velocity")
    if "position" not in case.measured:
        return 0.0
    t, q = (values["position"][case.mask["position"]] for values in (case.t, case.measured))
    lag = max(1, round(_LAG / _period(case)))
    return _quantile((q[lag:] - q[:-lag]) / (t[lag:] - t[:-lag])) if len(q) > lag else 0.0


def _period(case: Case) -> float:
    """Return the time between samples of the channel that has most of them, s."""
    return min([float(np.median(np.diff(t))) for t in case.t.values() if len(t) > 1], default=math.nan)


def _largest(case: Case, channel: str) -> float:
    return _quantile(case.measured[channel][case.mask[channel]])


def _quantile(values: FloatArray) -> float:
    return float(np.quantile(np.abs(values), LARGEST)) if len(values) else 0.0


_ROUNDS = 3
"""Fits, and states behind gaps, in turn."""


def settled_starts(problem: Problem, theta: FloatArray, run: Map = serial) -> tuple[Problem, FloatArray]:
    """Return a problem whose drives begin anew where its fit has them, and coordinates near it.

    The same where no record has a gap, or no output moves.
    """
    settled = _with_load_starts(problem, theta)
    if settled is problem:
        return problem, theta
    for _ in range(_ROUNDS):
        theta = solve(settled, theta, run=run).theta
        settled = _with_load_starts(settled, theta)
    return settled, theta


def _with_load_starts(problem: Problem, theta: FloatArray) -> Problem:
    """Return a problem that begins in the states that fit best at theta, and fits what is left of them."""
    rig, clocks = apply(problem.rig, problem.unknowns, theta)
    cases = tuple(_started(case, rig, clocks, problem) for case in problem.cases)
    same = all(a is b for a, b in zip(cases, problem.cases, strict=True))
    return problem if same else replace(problem, cases=cases)


def _started(case: Case, rig: Rig, clocks: Clocks, problem: Problem) -> Case:
    drive, channel = case.drive, next((n for n in ("deflection", "ft") if n in case.measured), "deflection")
    if not isinstance(drive, Drive) or not any(k > 0 for k, _ in drive.restarts):
        return case
    if rig.rigid_spring or mechanics(rig.under(case.source)).order < 2:
        return case
    states = np.array([_state(case, channel, k, drive.step, state) for k, state in drive.restarts])
    off = np.array([case.noise.get("position", OFF), case.noise.get(channel, OFF)])
    sizes = np.outer(off, (1.0, 1.0 / APART)).ravel()
    others = [_beginning(drive, channel, states + change) for change in np.diag(sizes)]
    begun = replace(case, drive=_beginning(drive, channel, states))
    own, shown = shown_by_starts(begun, others, rig, clocks, problem)
    ends = [*(k for k, _ in drive.restarts[1:]), len(drive.command)]
    starts = {n: (np.zeros((len(columns), 4 * len(states))), case.mask[n]) for n, columns in shown.items()}
    for i, ((k, _), end) in enumerate(zip(drive.restarts, ends, strict=True)):
        for n, columns in shown.items():
            behind = slice(*np.searchsorted((case.t[n] - drive.start) / drive.step, (k, end)))
            starts[n][0][behind, 4 * i : 4 * i + 4] = columns[behind]
    states += sizes * change_of_starts(replace(case, starts=starts), own).reshape(-1, 4)
    return replace(case, drive=_beginning(drive, channel, states), starts=starts)


def _state(
    case: Case, channel: str, k: int, step: float, state: tuple[float, float] | SpringStart | LoadStart
) -> FloatArray:
    """Return position, speed, and what the spring's sensor shows with its rate, shape (4,)."""
    if isinstance(state, LoadStart):
        return np.array([*state[:2], *state.spring[1:]])
    t = case.start + k * step
    shown = float(np.interp(t, case.t[channel], case.measured[channel])) if channel in case.t else 0.0
    return np.array([*(state if not isinstance(state, SpringStart) else (0.0, 0.0)), shown, 0.0])


def _beginning(drive: Drive, channel: str, states: FloatArray) -> Drive:
    """Return a drive that begins anew in some states, shape (restarts, 4)."""
    starts = [LoadStart(q, w, SpringStart(channel, y, rate)) for q, w, y, rate in states.tolist()]
    return replace(drive, restarts=tuple((k, s) for (k, _), s in zip(drive.restarts, starts, strict=True)))
