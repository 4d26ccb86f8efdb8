"""A few short pieces of a record, spread over it: enough to tell promising hypotheses from hopeless ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.split import BLOCK, FIT, part
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive

_RUN_UP = 0.5
"""s before a piece that are simulated and not compared: the state there is the measured one."""
_ENOUGH = 14.0
"""s of data in all pieces together."""


def windows_of(case: Case) -> tuple[Case, ...]:
    """Return pieces of a case, each a run-up and the FIT blocks after it, about 14 s of data in all.

    A case of a measured motion (inverse model) costs little and is returned whole.
    """
    fit = part(case, FIT)
    drive = case.drive
    if not isinstance(drive, Drive) or drive.duration < 2.0 * _ENOUGH:
        return (fit,)
    starts = np.arange(4.0 * BLOCK, drive.duration - 2.0 * BLOCK, 4.0 * BLOCK)
    every = max(1, round(len(starts) * 2.0 * BLOCK / _ENOUGH))
    return tuple(
        _piece(fit, drive, float(t) - _RUN_UP, float(t) + 2.0 * BLOCK) for t in starts[every // 2 :: every]
    )


def _piece(case: Case, drive: Drive, begin: float, end: float) -> Case:
    """Return the part of a case between two times since its start, s."""
    first, last = int(begin / drive.step), int(end / drive.step)
    start = drive.start + first * drive.step
    inside = {n: (t >= start) & (t < drive.start + end) for n, t in case.t.items()}
    cut = replace(
        drive,
        start=start,
        command=drive.command[first:last],
        at={n: drive.at[n][keep] - first for n, keep in inside.items()},
        impulse={n: drive.impulse[n][keep] for n, keep in inside.items()},
        reference=drive.reference[first:last],
        angle=drive.angle[first:last],
        initial=_state_at(case, start),
        origin=drive.origin + first * drive.step,
        whole=drive.drift_time,
    )
    return replace(
        case,
        drive=cut,
        t={n: t[inside[n]] for n, t in case.t.items()},
        measured={n: y[inside[n]] for n, y in case.measured.items()},
        mask={n: m[inside[n]] for n, m in case.mask.items()},
    )


def _state_at(case: Case, t: float) -> tuple[float, float]:
    """Return measured position (rad) and velocity (rad/s) at a time."""
    position, velocity = (
        float(np.interp(t, case.t[n], case.measured[n])) if n in case.measured else 0.0
        for n in ("position", "velocity")
    )
    return position, velocity
