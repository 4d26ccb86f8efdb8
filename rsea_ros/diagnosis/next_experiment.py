"""The next experiment: the cheapest run that rig and driver allow and that would separate rivals, simulated.

Each possible excitation, as large as rig and driver allow, is applied to the accepted model; the rival, with
all its unknowns, is fitted to that (one linearised step), and its residual is compared with the
sensors' noise. No run is recommended where none would separate them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.result import Experiment
from rsea_ros.errors import RseaError
from rsea_ros.identification.excitation import JOINT, PERIODIC, ExcitationSettings, excitation
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.result import AT_NOISE
from rsea_ros.identification.solver import Solution, bounded_step, jacobian
from rsea_ros.identification.unknowns import apply, start_vector
from rsea_ros.model.drive import Drive, drive_from
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_limits import POWER, SLEW, derive, felt_through_spring
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import UNITS, Channel, FloatArray, Record

SLOWEST, FASTEST = 50.0, 1000.0
"""Hz, of the node excite."""
_TRIES, _CLOSER = 4, 0.98
"""How often an amplitude is brought down until a run is allowed; what it stays below the limit by then."""
_SHOWN = ("position", "velocity", "ft")
_LENGTH, _PERIOD, _SERIES = 12.0, 4.0, 60.0
"""s: of a run that separates rivals and of its period, and of one at another amplitude, as long as a usual
record."""
_SEPARATES = 0.5
"""RMS of what a rival cannot follow, over the noise: 3360 samples lie 10 standard deviations above noise."""
_TOP = 60.0
"""Hz, of a series of amplitudes: above it the driver's limit of the slew leaves little amplitude."""
_NEARLY = 0.8
"""Part of the wanted amplitude that the limits must leave: with less the two are too alike to compare."""


@dataclass(frozen=True)
class AllowedRun:
    """An excitation by its settings, which excite has too, and the noise-free case of a rig under it.

    peak: the largest command, N m, or rad where positions command the rig.
    """

    kind: str
    settings: ExcitationSettings
    peak: float
    case: Case


def playable_rate(rate: float) -> float:
    """Return a rate, Hz, that excite has: a period of whole seconds is a whole number of its samples."""
    return min(max(float(round(rate)), SLOWEST), FASTEST)


def allowed_run(
    rig: Rig, like: Case, kind: str, settings: ExcitationSettings, peak: float
) -> AllowedRun | None:
    """Return a run of at most a peak that stays within the limits in simulation; None where none does.

    like: the case of the present run, whose travel is the largest where nothing else bounds it. settings:
    amplitude and noise count by their ratio.
    """
    bounds = _bounds(rig, like)
    for _ in range(_TRIES):
        try:
            scaled, command = _scale(kind, settings, peak)
            case, outputs = _simulate(rig, like, command, settings.rate)
        except RseaError:
            return None
        share = _share(command, outputs, bounds, settings.rate)
        if share <= 1.0:
            return AllowedRun(kind, scaled, float(np.max(np.abs(command))), case)
        if not math.isfinite(share):
            return None
        peak *= _CLOSER / share
    return None


def _bounds(rig: Rig, like: Case) -> Mapping[str, float]:
    """Return the limits by simulated quantity, as a driver derives them for the rig.

    A rig that positions command bounds its own torque.
    """
    present: dict[str, float] = {
        n: float(np.nanmax(np.abs(y))) for n, y in like.measured.items() if n in ("position", "velocity")
    }
    if rig.loop is not None:
        return {"command": present.get("position", math.inf), **present}
    limits, sources = derive({}, rig)
    bounds = present | {
        "command": limits["torque"], "slew": SLEW, "velocity": limits["velocity"], "power": POWER,
    }  # fmt: skip
    if rig.rigid_spring:
        return bounds
    if rig.clamped == set(END_NAMES):
        return {**bounds, "position": limits["deflection"], "ft": limits["ft"]}
    felt_through_spring(limits, sources, rig)
    return {**bounds, "ft": limits["ft"]}


def _scale(kind: str, settings: ExcitationSettings, peak: float) -> tuple[ExcitationSettings, FloatArray]:
    """Return settings and command whose largest value is the peak: both grow with amplitude and noise."""
    largest = float(np.max(np.abs(excitation(kind, settings))))
    factor = peak / largest
    amplitude, noise = (_round_down(factor * value) for value in (settings.amplitude, settings.noise))
    scaled = replace(settings, amplitude=amplitude, noise=noise)
    return scaled, excitation(kind, scaled)


def _round_down(value: float) -> float:
    """Return a value with four digits, rounded towards zero, for a person to type."""
    if value == 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / unit + 1e-9) * unit:.4g}")


def _simulate(
    rig: Rig, like: Case, command: FloatArray, rate: float
) -> tuple[Case, Mapping[str, FloatArray]]:
    """Return a case with the rig's noise-free measurements, and all limited quantities."""
    t = np.arange(len(command)) / rate
    names = sorted({*like.measured, *filter(rig.measures, _SHOWN)})
    blank = {n: Channel(t + 1.0 / rate, np.zeros(len(t))) for n in names}
    drive = drive_from(Record({"command": Channel(t, command), **blank}))
    outputs = simulate_drive(rig, drive)
    shown = {n: outputs[n] for n in like.measured}
    case = Case(
        replace(drive, at={n: drive.at[n] for n in shown}), {n: blank[n].t for n in shown},
        shown, like.noise, {n: np.ones(len(t), bool) for n in shown},
    )
    return case, outputs


def _share(
    command: FloatArray, outputs: Mapping[str, FloatArray], bounds: Mapping[str, float], rate: float
) -> float:
    """Return the largest share of a limit that a run takes; not finite where it runs away."""
    around = np.concatenate([[0.0], command, [0.0]])
    peaks = {n: float(np.max(np.abs(y))) for n, y in outputs.items()}
    peaks["command"] = float(np.max(np.abs(command)))
    peaks["slew"] = rate * float(np.max(np.abs(np.diff(around))))
    peaks["power"] = float(np.max(np.abs(command * outputs["velocity"])))
    return max(peaks[n] / bound for n, bound in bounds.items() if n in peaks)


@dataclass(frozen=True)
class ExcitationOption:
    """An excitation that could be run: kind, amplitude relative to the present one, band."""

    kind: str
    relative: float
    low: float
    high: float

    @property
    def cost(self) -> float:
        """The demand on the bench: amplitude first; a decade of bandwidth counts as a tenth more of it."""
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


def separating_run(accepted: Solution, rivals: Sequence[Solution], rate: float) -> Experiment:
    """Return the cheapest allowed run that separates an accepted model from its rivals, if there is one."""
    case = accepted.problem.cases[0]
    undecided = Experiment(
        "other_amplitude", accepted.problem.newest, tuple(r.problem.newest for r in rivals)
    )
    if not isinstance(case.drive, Drive):
        return undecided
    present = float(np.max(np.abs(case.drive.command)))
    rig, most = _model(accepted), 0.0
    for option in sorted(EXCITATIONS, key=lambda c: c.cost):
        run = allowed_run(rig, case, option.kind, _settings(option, rate), option.relative * present)
        if run is None:
            continue
        separation = min(_remainder(replace(r.problem, cases=(run.case,)), r.theta) for r in rivals)
        if separation > _SEPARATES:
            settings = _as_excited(run, rig) | {"separation_times_noise": round(separation, 3)}
            return replace(undecided, reason="separates", separation=separation, excitation=settings)
        most = max(most, separation)
    return replace(undecided, reason="inseparable", separation=most)


def _settings(option: ExcitationOption, rate: float) -> ExcitationSettings:
    """Return the settings of an option, of any amplitude."""
    rate = playable_rate(rate)
    return ExcitationSettings(
        rate=rate, duration=_LENGTH, amplitude=0.5, noise=0.2 if option.kind == "chirp" else 0.0,
        low=option.low, high=min(option.high, 0.45 * rate), period=_PERIOD, seed=7,
    )  # fmt: skip


def _as_excited(run: AllowedRun, rig: Rig) -> dict[str, float | str]:
    """Return a run as parameters of the node excite, with its peak and the unit."""
    s, unit = run.settings, UNITS["command" if rig.loop is None else "reference"]
    given: dict[str, float | str] = {
        "kind": run.kind, "amplitude": s.amplitude, "unit": unit, "low": s.low,
        "high": s.high, "duration": s.duration, "rate": s.rate, "seed": s.seed, "peak": round(run.peak, 3),
    }  # fmt: skip
    given |= {"noise": s.noise} if run.kind == "chirp" else {}
    return given | ({"period": s.period} if run.kind in PERIODIC or run.kind == "steps" else {})


def _model(solution: Solution) -> Rig:
    """Return the rig of a fit."""
    return apply(solution.problem.rig, solution.problem.unknowns, solution.theta)[0]


def _remainder(problem: Problem, theta: FloatArray) -> float:
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


def amplitude_series(model: Solution, times_noise: float, rate: float) -> Experiment | None:
    """Return the run that shows whether an unexplained residual grows with the amplitude.

    times_noise: RMS of that residual over the noise. At half the amplitude it must still be seen; else twice
    the amplitude would show it, within the limits; None where neither would.
    """
    case, rig = model.problem.cases[0], _model(model)
    excess = math.sqrt(max(times_noise**2 - 1.0, 0.0))
    factors = [f for f in (0.5, 2.0) if math.hypot(1.0, f * excess) >= AT_NOISE]
    if not isinstance(case.drive, Drive):  # it drifts: no simulation predicts how far another run would go
        return Experiment("amplitude_series", amplitude=0.5) if 0.5 in factors else None
    present = float(np.max(np.abs(case.drive.command)))
    for factor in factors:
        run = allowed_run(rig, case, "multisine", _series(rig, playable_rate(rate)), factor * present)
        if run is not None and run.peak >= _NEARLY * factor * present:
            return Experiment("amplitude_series", amplitude=factor, excitation=_as_excited(run, rig))
    return None


def _series(rig: Rig, rate: float) -> ExcitationSettings:
    high = min(_TOP if rig.loop is None else JOINT.high, 0.45 * rate)
    return ExcitationSettings(
        rate=rate, duration=_SERIES, amplitude=0.5, noise=0.0, low=0.1, high=high
    )
