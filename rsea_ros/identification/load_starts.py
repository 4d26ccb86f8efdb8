"""States in which a moving output begins anew behind gaps of its record, fitted to what follows.

Behind lost commands the sensors show where the gear is and how fast; a load that moves is elsewhere by all
that it did meanwhile, which no sensor shows at once. Position, speed, and the spring's torque or deflection
with its rate are linear unknowns of the samples until the next gap.
"""

from dataclasses import replace

import numpy as np

from rsea_ros.identification.problem import Case, Problem, simulate_cases, weighted_residual
from rsea_ros.identification.unknowns import Clocks, apply
from rsea_ros.model.drive import Drive, LoadStart, SpringStart
from rsea_ros.model.equations import mechanics
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

_FEWEST = 16
"""Samples behind a gap that tell a state."""
_APART = 0.03
"""s, over which a rate is known to the noise of its sensor: the size of the changes for derivatives."""
_SHARES = 1e-6
"""Of the largest singular value: what is less is not told."""


def with_load_starts(problem: Problem, theta: FloatArray) -> Problem:
    """Return a problem whose drives begin anew, behind gaps, in the states that fit best at theta.

    Its residuals are without what an error of these states makes, to first order. The same problem where no
    record has a gap, or no output moves.
    """
    rig, clocks = apply(problem.rig, problem.unknowns, theta)
    cases = tuple(_started(case, rig.under(case.source), clocks, problem) for case in problem.cases)
    same = all(a is b for a, b in zip(cases, problem.cases, strict=True))
    return problem if same else replace(problem, cases=cases)


def _started(case: Case, rig: Rig, clocks: Clocks, problem: Problem) -> Case:
    drive, channel = case.drive, next((n for n in ("deflection", "ft") if n in case.measured), "")
    if not isinstance(drive, Drive) or not channel or not any(k > 0 for k, _ in drive.restarts):
        return case
    if rig.rigid_spring or mechanics(rig).order < 2:
        return case
    states = np.array([_state(case, channel, k, drive.step, state) for k, state in drive.restarts])
    off = case.noise.get("position", 1e-4), case.noise[channel]
    sizes = np.array([off[0], off[0] / _APART, off[1], off[1] / _APART])
    tried = [states, *(states + size * direction for size, direction in zip(sizes, np.eye(4), strict=True))]
    moved = [replace(case, drive=_beginning(drive, channel, one), start_shows=None) for one in tried]
    outputs = simulate_cases(moved, rig, clocks, on_angle=problem.on_angle)[0]
    channels = problem.present(case)
    base, *others = (weighted_residual(c, out, channels) for c, out in zip(moved, outputs, strict=True))
    columns = np.column_stack([other - base for other in others])
    at = np.concatenate([(case.t[n][case.mask[n]] - drive.start) / drive.step for n in channels])
    ends = [*(k for k, _ in drive.restarts[1:]), len(drive.command)]
    shows = np.zeros((len(base), 4 * len(states)))
    for n, (row, (k, _), end) in enumerate(zip(states, drive.restarts, ends, strict=True)):
        inside = (at >= k) & (at < end) & np.isfinite(columns).all(axis=1) & np.isfinite(base)
        if np.count_nonzero(inside) >= _FEWEST:
            row -= sizes * np.linalg.lstsq(columns[inside], base[inside], rcond=_SHARES)[0]
            shows[inside, 4 * n : 4 * n + 4] = np.linalg.qr(columns[inside])[0]
    return replace(case, drive=_beginning(drive, channel, states), start_shows=shows)


def _state(
    case: Case, channel: str, k: int, step: float, state: tuple[float, float] | SpringStart | LoadStart
) -> FloatArray:
    """Return position, speed, and what the spring's sensor shows with its rate, shape (4,)."""
    if isinstance(state, LoadStart):
        return np.array([*state[:2], *state.spring[1:]])
    t = case.start + k * step
    shown = float(np.interp(t, case.t[channel], case.measured[channel]))
    return np.array([*(state if not isinstance(state, SpringStart) else (0.0, 0.0)), shown, 0.0])


def _beginning(drive: Drive, channel: str, states: FloatArray) -> Drive:
    """Return a drive that begins anew in some states, shape (restarts, 4)."""
    starts = [LoadStart(q, w, SpringStart(channel, y, rate)) for q, w, y, rate in states.tolist()]
    return replace(drive, restarts=tuple((k, s) for (k, _), s in zip(drive.restarts, starts, strict=True)))
