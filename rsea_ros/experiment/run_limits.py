"""Limits of a run, and the file that a player reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import ParameterError
from rsea_ros.identification.excitation import FEWEST_SAMPLES
from rsea_ros.records.record import FloatArray

UNITS: Mapping[str, str] = {
    "torque": "N m",
    "slew": "N m/s",
    "heat": "N m",
    "deflection": "rad",
    "velocity": "rad/s",
    "travel": "rad",
    "power": "W",
    "ft": "N m",
}


@dataclass(frozen=True)
class RunLimits:
    """The largest size of each quantity either way; infinite where nothing limits it.

    torque: of the command. slew: its change from one command to the next, over their period. heat: its RMS
    over the run, which the heat in a motor's winding follows (no rig states a thermal model, so this stands
    for its temperature). deflection: of the spring. velocity, travel: of the gear output against the
    housing. power: mechanical, command times velocity. ft: torque at the F/T sensor. Raises ParameterError
    for a limit that is not above zero, and without one of the torque.
    """

    torque: float
    slew: float = math.inf
    heat: float = math.inf
    deflection: float = math.inf
    velocity: float = math.inf
    travel: float = math.inf
    power: float = math.inf
    ft: float = math.inf

    def __post_init__(self) -> None:
        for name, unit in UNITS.items():
            value = getattr(self, name)
            if not value > 0.0:
                raise ParameterError(f"limit {name} = {value:g} {plain(unit)}, expected > 0 {plain(unit)}")
        if math.isinf(self.torque):
            raise ParameterError(
                "limit torque = inf N·m, expected a finite torque: nothing else bounds a run"
            )

    def finite_limits(self) -> dict[str, float]:
        """Return the finite limits by name."""
        return {f.name: v for f in fields(self) if math.isfinite(v := getattr(self, f.name))}


def limits_from(text: str) -> RunLimits:
    """Return the limits of `torque=20,velocity=0.5`. Raises ParameterError for text of another form."""
    values: dict[str, float] = {}
    for item in filter(None, text.split(",")):
        name, _, value = (part.strip() for part in item.partition("="))
        if name not in UNITS:
            near = did_you_mean(name, UNITS)
            raise ParameterError(f"--limits: {quote(name)}, expected one of {', '.join(UNITS)}{near}")
        if not is_decimal(value):
            expected = f"expected a number in {plain(UNITS[name])}"
            raise ParameterError(f"--limits: {name} = {quote(value)}, {expected}")
        if name in values:
            raise ParameterError(f"--limits: {name} is given twice, expected once")
        values[name] = float(value)
    if "torque" not in values:
        raise ParameterError("--limits: no torque, expected at least torque=… in N·m")
    return RunLimits(**values)


def of_command(command: FloatArray, rate: float) -> dict[str, float]:
    """Return the peaks of a command itself: its size, its slew, its RMS while it is not at rest. rate: Hz."""
    around = np.concatenate([[0.0], command, [0.0]])
    return {
        "torque": float(np.max(np.abs(command))),
        "slew": float(np.max(np.abs(np.diff(around)))) * rate,
        "heat": float(np.sqrt(np.mean(np.trim_zeros(command) ** 2))) if command.any() else 0.0,
    }


def of_response(command: FloatArray, outputs: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return the largest deflection, velocity, travel, power and F/T torque of a simulated run."""
    size = {n: float(np.max(np.abs(y))) for n, y in outputs.items()}
    peaks = {"velocity": size["velocity"], "travel": size["position"]}
    peaks["power"] = float(np.max(np.abs(command * outputs["velocity"])))
    if "ft" in size:
        peaks |= {"ft": size["ft"], "deflection": size["deflection"]}
    return peaks


def largest_share(peaks: Mapping[str, float], limits: RunLimits) -> float:
    """Return the largest share of a limit that is used; above 1 a limit is exceeded."""
    shares = [peaks[n] / limit for n, limit in limits.finite_limits().items() if n in peaks]
    return max((s if math.isfinite(s) else math.inf for s in shares), default=0.0)


HEAD = "t,command"
_UNEVEN = 1e-3


def run_text(command: FloatArray, rate: float) -> str:
    """Return the text of a run. rate: Hz."""
    rows = (f"{k / rate:.9g},{float(value):.9g}" for k, value in enumerate(command))
    return "\n".join([HEAD, *rows, ""])


def read_run(path: str | Path) -> tuple[FloatArray, float]:
    """Return command (N m) and rate (Hz) of a run's file.

    Raises ParameterError for a file of another form, OSError for one that cannot be read.
    """
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    if not lines or lines[0].strip() != HEAD:
        raise ParameterError(
            f"{path}: begins with {lines[0][:40] if lines else 'nothing'!r}, expected {HEAD}"
        )
    try:
        rows = np.array([[float(v) for v in line.split(",")] for line in lines[1:] if line.strip()])
    except ValueError as error:
        raise ParameterError(f"{path}: {error}, expected two numbers a line") from None
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < FEWEST_SAMPLES or not np.isfinite(rows).all():
        raise ParameterError(f"{path}: expected {FEWEST_SAMPLES} lines or more of two finite numbers")
    periods = np.diff(rows[:, 0])
    if not periods.min() > 0.0 or np.ptp(periods) > _UNEVEN * periods.mean():
        raise ParameterError(
            f"{path}: t rises by {periods.min():g} to {periods.max():g} s, expected an even rate"
        )
    return rows[:, 1], float(1.0 / periods.mean())
