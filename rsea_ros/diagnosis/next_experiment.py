"""The next experiment: the cheapest run that would tell rivals apart, by simulating them.

Each possible excitation is applied to the accepted model; the rival, with all that it may move, is fitted to
that (one linearised step), and what it cannot follow is held against the sensors' noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.result import Experiment
from rsea_ros.errors import RseaError
from rsea_ros.identification.excitation import JOINT, Settings, excitation
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Solution, bounded_step, jacobian
from rsea_ros.identification.unknowns import apply, start_vector
from rsea_ros.model.drive import Drive, drive_from
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.signals import UNITS, Channel, FloatArray, Record
from rsea_ros.wording import listed

_DURATION = 12.0
_ENOUGH = 0.5
"""RMS of what a rival cannot follow, over the noise, that tells it apart in a run of 12 s beyond doubt."""


@dataclass(frozen=True)
class ExcitationOption:
    """An excitation that could be run: kind, amplitude relative to the present one, band."""

    kind: str
    relative: float
    low: float
    high: float

    @property
    def cost(self) -> float:
        """What it asks of the bench: amplitude first, then bandwidth."""
        return self.relative * (1.0 + 0.1 * math.log10(self.high / self.low))


EXCITATIONS = tuple(
    ExcitationOption(kind, relative, low, high)
    for relative in (0.25, 0.5, 1.0, 1.5)
    for kind, low, high in (
        ("steps", 0.1, 10.0),
        ("multisine", 0.1, 5.0),
        ("multisine", 2.0, 60.0),
        ("multisine", 20.0, 120.0),
        ("chirp", 0.05, 120.0),
    )
)


def separating(accepted: Solution, rivals: Sequence[Solution], rate: float) -> Experiment:
    """Return the cheapest run that tells an accepted model from its rivals, or say that none does."""
    case = accepted.problem.cases[0]
    names = listed([r.problem.added[-1] for r in rivals])
    cause = accepted.problem.added[-1]
    if not isinstance(case.drive, Drive):
        return Experiment(
            f"{cause} and {names} do as well on these data; a run at another amplitude would show more", {}
        )
    present = float(np.max(np.abs(case.drive.command)))
    tried = []
    for option in sorted(EXCITATIONS, key=lambda c: c.cost):
        separation = min(_separation(accepted, rival, option, present, rate) for rival in rivals)
        tried.append((separation, option))
        if separation > _ENOUGH:
            break
    separation, best = max(tried, key=lambda item: item[0])
    return _worded(cause, names, separation, best, present, unit_of_commands(accepted.problem.rig))


def unit_of_commands(rig: Rig) -> str:
    """Return the unit of what commands a rig: torques, or target positions."""
    return UNITS["command" if rig.loop is None else "reference"]


def _worded(
    cause: str, names: str, separation: float, best: ExcitationOption, present: float, unit: str
) -> Experiment:
    run: dict[str, float | str] = {
        "kind": best.kind,
        "amplitude": round(best.relative * present, 3),
        "unit": unit,
        "low": best.low,
        "high": best.high,
        "duration": _DURATION,
        "separation_times_noise": round(separation, 3),
    }
    if separation > _ENOUGH:
        return Experiment(
            f"{cause} and {names} do as well on these data; "
            f"this run makes them differ by {separation:.1f} times the noise",
            run,
        )
    return Experiment(
        f"{cause} and {names} make the same motion under every excitation tried "
        f"(at most {separation:.2f} times the noise apart): "
        "only a separate measurement distinguishes them, such as the spring stiffness by a known weight",
        run,
    )


def _separation(
    accepted: Solution, rival: Solution, option: ExcitationOption, present: float, rate: float
) -> float:
    """Return what a rival cannot follow of the accepted model under an excitation, over the noise."""
    try:
        case = _simulated(accepted, option, option.relative * present, rate)
    except RseaError:
        return 0.0
    problem = replace(rival.problem, cases=(case,))
    return _left_over(problem, rival.theta)


def _simulated(accepted: Solution, option: ExcitationOption, amplitude: float, rate: float) -> Case:
    """Return a case whose measurements are the accepted model's own, without noise."""
    settings = Settings(
        rate=rate,
        duration=_DURATION,
        amplitude=0.5 * amplitude,
        noise=0.2 * amplitude,
        low=option.low,
        high=min(option.high, 0.45 * rate),
        period=4.0,
        seed=7,
    )
    values = excitation(option.kind, settings)
    values = values * min(1.0, amplitude / float(np.max(np.abs(values))))
    t = np.arange(len(values)) / rate
    old = accepted.problem.cases[0]
    blank = {n: Channel(t + 1.0 / rate, np.zeros(len(t))) for n in old.measured}
    drive = drive_from(Record({"command": Channel(t, values), **blank}))
    rig, _ = apply(accepted.problem.rig, accepted.problem.unknowns, accepted.theta)
    outputs = simulate_drive(rig, drive)
    return Case(
        drive,
        {n: c.t for n, c in blank.items()},
        outputs,
        old.noise,
        {n: np.ones(len(t), bool) for n in outputs},
    )


def _left_over(problem: Problem, theta: FloatArray) -> float:
    """Return the RMS of the worst channel's weighted residual after one linearised step of all unknowns."""
    outputs = problem.outputs(theta)
    residual = problem.residual_of(outputs)
    matrix = jacobian(problem, theta, residual)
    prior = np.array([1.0 / u.doubt for u in problem.unknowns])
    normal = matrix.T @ matrix + np.diag(prior**2 + 1e-12)
    slope = matrix.T @ residual + prior**2 * (theta - start_vector(problem.unknowns))
    moved = problem.outputs(bounded_step(problem, theta, normal, slope))
    case = problem.cases[0]
    rms = [
        np.sqrt(np.mean(((moved[0][n] - case.measured[n]) / case.noise[n]) ** 2))
        for n in problem.present(case)
    ]
    return float(min(max(rms), np.sqrt(np.mean(residual**2)) * len(rms)))


def amplitude_series(amplitude: float, rig: Rig) -> Experiment:
    """Return the run that says of an unexplained residual whether it grows with the amplitude.

    amplitude: of the present run, in the unit of what commands the rig.
    """
    why = (
        "nothing in the catalogue explains the residual: repeat at half the amplitude with an odd multisine, "
        "whose empty lines show distortion apart from noise; "
        "what scales with the command is linear, what does not is friction-like"
    )
    return Experiment(
        why,
        {
            "kind": "multisine",
            "amplitude": round(0.5 * amplitude, 3),
            "unit": unit_of_commands(rig),
            "low": 0.1,
            "high": 120.0 if rig.loop is None else JOINT.high,
            "duration": 60.0,
        },
    )
