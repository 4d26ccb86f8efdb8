"""Rival models of the paper: lumped ones, and the moving-output test that decides between them.

The reflected rotor inertia is taken for an inertia of the chassis against the ground, J_eff = J_sc + J_m,
and the motor for a torque between ground and chassis: the housing's motion is left out. With both ends
clamped this changes T_p, Eqs. (2) and (3), and nothing in T_d, Eq. (1).

A rig with `train: lumped` and a free housing grounds the rotor only; its loads move. Fig. 18 can be read
either way; its models are compared off any grid: where each resonates, how far apart two of them come.

The moving-output test (section 3.2.2): the bench's free values differ from the rig's by draws from its own
spread; the command is the paper's white noise of 30 N m, half of it for the fit and half held out. The lumped
model is fitted with loose priors, so that only its structure limits it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.identification.identify import identify
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.prediction_errors import Comparison, predict
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.model.transfer import end_response
from rsea_ros.records.record import Channel, FloatArray, Record


@dataclass(frozen=True)
class HeldOutFit:
    """A rival on one held-out record.

    sensor: which end its F/T sensor is on. explained: share of the variance of its torque,
    1 - var(error) / var(measured), negative where no model would be better. fit_percent: %.
    rms_error, rms: of the error and of the measurement, N m.
    """

    sensor: str
    explained: float
    fit_percent: float
    rms_error: float
    rms: float


@dataclass(frozen=True)
class Rival:
    """A model by name with its fitted rig."""

    name: str
    rig: Rig
    held_out: tuple[HeldOutFit, ...]


def compare(
    rivals: Mapping[str, Rig], train: Record, holdout: Sequence[tuple[str, Record]]
) -> tuple[Rival, ...]:
    """Fit every rig to `train` and test it on held-out records, each with the end of its sensor.

    Nothing is fitted to the held-out records: a second sensor tests what the first one identified.
    """
    fitted = {name: identify([train], rig, of_misfit=False).rig for name, rig in rivals.items()}
    return tuple(Rival(n, rig, tuple(test_on(rig, *held) for held in holdout)) for n, rig in fitted.items())


def test_on(rig: Rig, end: str, record: Record) -> HeldOutFit:
    """Return how well a rig predicts the torque that a sensor on an end recorded."""
    comparison: Comparison = predict(replace(rig, ft_end=end), record)["ft"]
    measured = comparison.measured[comparison.counts]
    error = (comparison.predicted - comparison.measured)[comparison.counts]
    return HeldOutFit(
        sensor=end,
        explained=float(1.0 - np.var(error) / np.var(measured)),
        fit_percent=comparison.fit_percent,
        rms_error=comparison.rms_error,
        rms=float(np.std(measured)),
    )


def lumped_rig(rig: Rig) -> Rig:
    """Return the rig of the lumped model; every function of the model accepts it."""
    return replace(rig, name=f"{rig.name}, lumped", train="lumped", clamped=rig.clamped | {"housing_end"})


_HZ: FloatArray = np.geomspace(0.1, 140.0, 400)


def readings(rig: Rig) -> dict[str, Rig]:
    """Return the models that Fig. 18 may compare: unlumped, and the lumped one in both readings.

    With moving loads only the rotor is grounded (`train: lumped`), as within the inner line of Fig. 16; the
    other takes the motor for a torque against the ground as well (lumped.py), as in Fig. 3.
    """
    return {
        "unlumped": rig,
        "lumped, loads moving": replace(rig, train="lumped"),
        "lumped, motor grounded": lumped_rig(rig),
    }


def resonance_hz(rig: Rig) -> float:
    """Return where the torque at the spring end is largest above 3 Hz, Hz."""
    hz = _HZ[_HZ >= 3.0]
    return _sharpen(hz, int(np.argmax(_decibel(rig, hz))), lambda f: -float(_decibel(rig, np.array([f]))[0]))


def largest_gap(rig: Rig, other: Rig) -> tuple[float, float]:
    """Return where two models are furthest apart, Hz, and by how much, dB."""

    def gap(hz: FloatArray) -> FloatArray:
        return np.abs(_decibel(rig, hz) - _decibel(other, hz))

    f = _sharpen(_HZ, int(np.argmax(gap(_HZ))), lambda f: -float(gap(np.array([f]))[0]))
    return f, float(gap(np.array([f]))[0])


def _decibel(rig: Rig, hz: FloatArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.abs(end_response(rig, hz))))


def _sharpen(hz: FloatArray, at: int, cost: Callable[[float], float]) -> float:
    """Return the minimum of a cost over log frequency, between the neighbours of a grid point."""
    low, high = (math.log(hz[k]) for k in (max(at - 1, 0), min(at + 1, len(hz) - 1)))
    best = minimize_scalar(lambda x: cost(math.exp(x)), bounds=(low, high), method="bounded")
    return math.exp(best.x)


NOISE = 30.0
"""N m, standard deviation (the paper prints N)."""
RATE, DURATION = 280.0, 160.0
_PART = 0.5
"""Of the rig's spread: how far the bench lies from what the rig states, one sigma."""

_LOOSE = 0.3
"""Relative spread, one sigma: thousands of samples outweigh it."""

Bag = Callable[[str, Record], Record]
"""Takes a record through a bag: name and record in, what is read back out."""


@dataclass(frozen=True)
class MovingOutput:
    """rivals: unlumped and lumped, fitted. responses: measured, F/T per command."""

    rivals: tuple[Rival, ...]
    responses: Mapping[str, FrequencyResponse]


def moving_output(
    rig: Rig, bag: Bag, *, duration: float = DURATION, seed: int = 5, channels: tuple[str, ...] = ("ft",)
) -> MovingOutput:
    """Run the test on the bench of a rig, with a sensor at each end where the rig has a proximal spring.

    channels: used by the fit beside the command; the paper had the F/T sensor alone.
    """
    true_rig = draw(rig, seed)
    values = excitation(
        "white_noise", ExcitationSettings(rate=RATE, duration=duration, amplitude=NOISE, seed=seed)
    )
    command = Channel(np.arange(len(values)) / RATE, values)
    ends = ["spring_end", *(["housing_end"] if "proximal_spring.stiffness" in rig.quantities else [])]
    played = {e: synthesize(replace(true_rig, ft_end=e), command, seed=seed + len(e)) for e in ends}
    records = {end: bag(f"{rig.name}_{end}", record) for end, record in played.items()}
    middle = 0.5 * duration
    train = _only(records["spring_end"].between(0.0, middle), channels)
    holdout = [(end, record.between(middle, duration + 1.0)) for end, record in records.items()]
    wide = {n: replace(rig.quantities[n], spread=_LOOSE) for n in rig.free()}  # priors that hold nothing back
    lumped = replace(lumped_rig(rig), quantities={**rig.quantities, **wide})
    rivals = compare({"unlumped": rig, "lumped": lumped}, train, holdout)
    return MovingOutput(rivals, {end: estimate_response(r, "ft") for end, r in records.items()})


def draw(rig: Rig, seed: int) -> Rig:
    """Return the rig with its free values drawn from half their spread, log-normal."""
    rng = np.random.default_rng(seed)
    factors = {n: float(np.exp(_PART * rig.spread(n) * rng.standard_normal())) for n in rig.free()}
    return rig.with_values({n: rig[n] * factor for n, factor in factors.items()})


def _only(record: Record, channels: tuple[str, ...]) -> Record:
    return replace(record, channels={n: c for n, c in record.channels.items() if n in ("command", *channels)})
