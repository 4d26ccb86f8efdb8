"""The shape of a run, the limits that it keeps, and the file that a player reads.

Every run begins and ends at zero torque under a raised cosine. Multisines have phases of low crest:
Schroeder's, then made flatter by clipping (Schroeder, IEEE Trans. Inf. Theory 16, 1970; van der Ouderaa,
Schoukens, Renneboog, IEEE Trans. Instrum. Meas. 37, 1988).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal

import numpy as np

from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import ParameterError
from rsea_ros.identification import excitation
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
        if name in UNITS and not is_decimal(value):
            expected = f"expected a number in {plain(UNITS[name])}"
            raise ParameterError(f"--limits: {name} = {quote(value)}, {expected}")
        if name in values:
            raise ParameterError(f"--limits: {name} is given twice, expected once")
        values[name] = float(value) if name in UNITS else math.nan
    return limits_of(values, "--limits")


def limits_of(values: Mapping[str, float], source: str = "limits") -> RunLimits:
    """Return the limits of values by name, SI. Raises ParameterError for an unknown name, or no torque."""
    for name in values:
        if name not in UNITS:
            near = did_you_mean(name, UNITS)
            raise ParameterError(f"{source}: {quote(name)}, expected one of {', '.join(UNITS)}{near}")
    if "torque" not in values:
        raise ParameterError(f"{source}: no torque, expected at least torque=… in N·m")
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
    fewest = excitation.FEWEST_SAMPLES
    if rows.ndim != 2 or rows.shape[1] != 2 or len(rows) < fewest or not np.isfinite(rows).all():
        raise ParameterError(f"{path}: expected {fewest} lines or more of two finite numbers")
    periods = np.diff(rows[:, 0])
    if not periods.min() > 0.0 or np.ptp(periods) > _UNEVEN * periods.mean():
        raise ParameterError(
            f"{path}: t rises by {periods.min():g} to {periods.max():g} s, expected an even rate"
        )
    return rows[:, 1], float(1.0 / periods.mean())


Kind = Literal["multisine", "chirp", "steps", "holds"]
RAMP = 0.25
"""s, of the soft start and stop; of a short run a quarter of it."""
LEAD, TAIL = 0.35, 0.25
"""s at rest before and after: the bench settles, and what it still does is recorded."""
_CLIPPINGS, _CLIP = 15, 0.85
_STEPS = np.array([1.0, -0.4, 0.7, -1.0, 0.3, -0.7, 0.4, 0.0])
_HOLDS = np.array([0.35, 0.7, 1.0, 0.7, 0.35, 0.0, -0.35, -0.7, -1.0, -0.7, -0.35, 0.0])


@dataclass(frozen=True)
class Shape:
    """The form of a run; see KINDS.

    amplitude: N m, peak of the moving part. bias: N m, held beside it. low, high: band, Hz, of multisine and
    chirp. tilt: an amplitude goes with frequency to the power of -tilt, 1. hold: s, of one level of steps (up
    and down at random) and holds (a staircase up and down). rest: share of the run, at its end, at zero.
    """

    kind: Kind
    amplitude: float
    bias: float = 0.0
    low: float = 0.1
    high: float = 60.0
    tilt: float = 0.0
    hold: float = 0.5
    rest: float = 0.0


def command_of(shape: Shape, duration: float, rate: float, slew: float = np.inf) -> FloatArray:
    """Return the command of a shape, N m, shape (n,), at rest for LEAD before it and TAIL after it.

    duration: s, of the excitation, its ramps and rest included. slew: N m/s. Where its change from sample to
    sample would be faster, a multisine or chirp gets smaller and a step becomes a ramp.
    """
    n = round(duration * rate)
    moving = n - round(shape.rest * n)
    part = KINDS[shape.kind](shape, moving, rate)
    run = excitation.ramp_ends(shape.bias + shape.amplitude * part, min(round(RAMP * rate), moving // 4))
    if np.isfinite(slew):
        run = slow(run, slew / rate, is_stepped=shape.kind in ("steps", "holds"))
    return at_rest_around(np.concatenate([run, np.zeros(n - moving)]), rate)


def at_rest_around(run: FloatArray, rate: float) -> FloatArray:
    """Return a run with its rest before and after."""
    return np.asarray(np.pad(run, (round(LEAD * rate), round(TAIL * rate))))


def slow(command: FloatArray, most: float, *, is_stepped: bool) -> FloatArray:
    """Return a command that changes by at most `most` from sample to sample, N m: smoothed, or smaller."""
    change = float(np.max(np.abs(np.diff(command, prepend=0.0, append=0.0))))
    if change <= most:
        return command
    if not is_stepped:
        return command * (most / change)
    width = int(np.ceil(change / most))
    smooth: FloatArray = np.convolve(command, np.full(width, 1.0 / width))[: len(command)]
    return excitation.ramp_ends(smooth, width)


@lru_cache(64)
def _flat_multisine(n: int, rate: float, low: float, top: float, tilt: float) -> FloatArray:
    """Return a multisine of low crest with lines n / rate apart, its peak 1, shape (n,)."""
    first = max(1, round(low * n / rate))
    lines = np.arange(first, max(first, int(top * n / rate)) + 1)
    size = (lines / lines[0]) ** -tilt
    power = size**2 / np.sum(size**2)
    spectrum = np.zeros(n // 2 + 1, complex)
    phase = -2.0 * np.pi * np.cumsum(np.concatenate([[0.0], np.cumsum(power)[:-1]]))
    spectrum[lines] = size * np.exp(1j * phase)
    for _ in range(_CLIPPINGS):
        signal = np.fft.irfft(spectrum, n)
        clipped = np.fft.rfft(np.clip(signal, *(np.array([-1.0, 1.0]) * _CLIP * np.max(np.abs(signal)))))
        spectrum[lines] = size * np.exp(1j * np.angle(clipped[lines]))
    signal = np.fft.irfft(spectrum, n)
    return np.asarray(signal / np.max(np.abs(signal)))


def _chirp(shape: Shape, n: int, rate: float) -> FloatArray:
    settings = excitation.ExcitationSettings(
        rate=rate, duration=n / rate, amplitude=1.0, noise=0.0, low=shape.low, high=_top(shape, rate)
    )
    return excitation.chirp(settings)[:n]


def _levels(levels: FloatArray, shape: Shape, n: int, rate: float) -> FloatArray:
    which = (np.arange(n) / rate / shape.hold).astype(np.int64)
    return np.asarray(levels[which % len(levels)])


def _top(shape: Shape, rate: float) -> float:
    return min(shape.high, excitation.NYQUIST_SHARE * rate / 2.0)


KINDS: Mapping[Kind, Callable[[Shape, int, float], FloatArray]] = {
    "multisine": lambda s, n, rate: _flat_multisine(n, rate, s.low, _top(s, rate), s.tilt),
    "chirp": _chirp,
    "steps": partial(_levels, _STEPS),
    "holds": partial(_levels, _HOLDS),
}
"""Each makes the moving part, its peak 1, from shape, number of samples and rate."""
FEWEST: Mapping[Kind, int] = {"multisine": 4, "chirp": 10, "steps": 4, "holds": 4}
"""Samples of a run, with which it still has its form, a soft start and a soft stop."""
