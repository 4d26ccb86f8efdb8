"""What an identification says, as values. Reports and files are made from these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rsea_ros.identification.statics import Statics
from rsea_ros.model.rig import Rig
from rsea_ros.signals import ComplexArray, Fault, FloatArray


@dataclass(frozen=True)
class FrequencyResponse:
    """A measured frequency response with its doubt.

    frequency: Hz, shape (n,). response: output per input, complex, shape (n,). coherence: 0 … 1, shape (n,).
    sd: standard deviation of the complex response (circular), same unit as response, shape (n,).
    noise, distortion: output amplitude (RMS per line) of noise and of nonlinear distortion, where the
    excitation allows to separate them, else None.
    """

    input: str
    output: str
    frequency: FloatArray
    response: ComplexArray
    coherence: FloatArray
    sd: FloatArray
    method: str
    noise: FloatArray | None = None
    distortion: FloatArray | None = None


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter in SI with its 95 % interval.

    told_by_data: share of what is known of it that the data brought, 1 - var(posterior) / var(prior).
    start: the value that the rig stated. spread: relative one-sigma prior spread around it.
    """

    name: str
    value: float
    unit: str
    ci95: tuple[float, float]
    start: float
    spread: float
    told_by_data: float


@dataclass(frozen=True)
class Overlay:
    """A channel of a record as measured and as simulated: s, and the channel's unit."""

    channel: str
    t: FloatArray
    measured: FloatArray
    simulated: FloatArray


@dataclass(frozen=True)
class Identification:
    """Parameters with confidence, how well they explain the record, and what the data cannot tell.

    rig: the rig with the identified values. residual_rms, noise_rms: by channel, in its unit.
    fit_percent: 100 (1 - ||e|| / ||y - mean y||) by channel. models: the fitted model's response at the
    frequencies of each of `responses`. statements: plain sentences, one each on what is not identifiable
    and what would make it so. statics: of slow ramps against a locked output.
    """

    rig: Rig
    sources: tuple[str, ...]
    duration: float
    rate: float
    parameters: tuple[ParameterEstimate, ...]
    correlation: FloatArray
    residual_rms: Mapping[str, float]
    noise_rms: Mapping[str, float]
    fit_percent: Mapping[str, float]
    responses: tuple[FrequencyResponse, ...] = ()
    models: tuple[ComplexArray, ...] = ()
    overlays: tuple[Overlay, ...] = ()
    statics: Statics | None = None
    statements: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    faults: tuple[Fault, ...] = field(default=())
