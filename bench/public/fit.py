"""For all public benchmarks: a rig fitted by output error on position, and its error on a test record.

The simulation, the effects and the solver are the project's; nothing is fitted to a test record but the two
numbers of its initial state, and those on the first samples only, which no score counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from bench import SHARED
from rsea_ros.identification.fit import unknowns_of
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, solve
from rsea_ros.identification.unknowns import apply
from rsea_ros.model.drive import Drive, drive_from
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import Channel, FloatArray, Record

DATA = SHARED / "realdata"
RIGS = Path(__file__).resolve().parent / "rigs"
REFINE = 4
"""Factor by which steps are shorter than usual: the errors scored here lie far below a sensor's noise."""


@dataclass(frozen=True)
class Score:
    """A test: its name, its error, published errors, and the limit asked for, inf for none."""

    test: str
    error: float
    unit: str
    published: str
    asked: float


def record_of(command: FloatArray, position: FloatArray, rate: float) -> Record:
    """Return a record whose two channels were sampled together."""
    t = np.arange(len(command)) / rate
    return Record({"command": Channel(t, command), "position": Channel(t, position)}, source="benchmark")


def case_of(
    rig: Rig, record: Record, skip: int, refine: int = REFINE, initial: tuple[float, float] = (0.0, 0.0),
) -> Case:  # fmt: skip
    """Return a record ready to be fitted to its position.

    skip: samples at the start that no residual looks at: the initial state, position and velocity, decays in
    them.
    """
    mask = np.arange(len(record["position"])) >= skip
    return Case(
        drive=replace(drive_from(record, hold=rig.hold, refine=refine), initial=initial),
        t={"position": record["position"].t},
        measured={"position": record["position"].y},
        noise={"position": rig.sensors["position"].noise},
        mask={"position": mask},
    )


def fit_rig(rig: Rig, cases: Sequence[Case], iterations: int = 60) -> Solution:
    """Return the fit of all free values of a rig and its effects, by output error on position."""
    unknowns = tuple(u for u in unknowns_of(rig, cases) if not u.is_clock)
    return solve(Problem(tuple(cases), rig, unknowns, ("position",)), iterations=iterations)


def rig_of(solution: Solution) -> Rig:
    """Return the rig with the values of a fit."""
    return apply(solution.problem.rig, solution.problem.unknowns, solution.theta)[0]


def error_of(
    rig: Rig, record: Record, skip: int = 0, refine: int = REFINE,
    initial: tuple[float, float] | None = (0.0, 0.0),
) -> float:  # fmt: skip
    """Return the RMS error on a test record, its first `skip` samples left out, in the position's unit.

    initial: position and velocity at the start; None: those that fit the first samples best.
    """
    drive, measured = drive_from(record, hold=rig.hold, refine=refine), record["position"].y
    started = replace(drive, initial=initial or _initial(rig, drive, measured[:skip]))
    return float(np.sqrt(np.mean((simulate_drive(rig, started)["position"] - measured)[skip:] ** 2)))


def _initial(rig: Rig, drive: Drive, measured: FloatArray) -> tuple[float, float]:
    """Return the position and velocity that fit the first samples best."""
    steps = int(drive.at["position"][len(measured)])
    at = {"position": drive.at["position"][: len(measured)]}
    short = replace(drive, command=drive.command[:steps], at=at)
    speed = np.ptp(measured) / max(drive.step * steps, 1e-9)

    def misfit(state: FloatArray) -> FloatArray:
        return simulate_drive(rig, replace(short, initial=tuple(state)))["position"] - measured

    found = least_squares(misfit, [measured[0], 0.0], x_scale=[np.ptp(measured), speed], diff_step=1e-3)
    return float(found.x[0]), float(found.x[1])
