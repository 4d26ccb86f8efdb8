"""The result of an identification as values, for reports and files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from rsea_ros.identification.determined import IDENTIFIABLE_SHARE, Determined, how_determined
from rsea_ros.identification.remark import Remark
from rsea_ros.identification.silent import silent_channels
from rsea_ros.identification.statics import Statics
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_choice import RigChoice
from rsea_ros.records.record import SENSED, ComplexArray, Fault, FloatArray

Verdict = Literal["adequate", "misfit", "not_identifiable"]
"""Whether the model fits down to the noise, and if so, whether the data determine any of its values."""
AT_NOISE = 1.1
"""RMS of a residual over the noise, up to which it is the noise."""


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


CLOCKS = ("clock.", "clock_rate.")
"""What the names of the sensors' clocks begin with."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter in SI with its 95 % interval.

    told_by_data: share of its information that comes from the data, 1 - var(posterior) / var(prior).
    start: the value that the rig stated. spread: relative one-sigma prior spread around it. spreads_off:
    distance of the value from it in spreads.
    """

    name: str
    value: float
    unit: str
    ci95: tuple[float, float]
    start: float
    spread: float
    told_by_data: float
    spreads_off: float = 0.0

    @property
    def is_identifiable(self) -> bool:
        """Return whether the data determine the value, rather than the rig's prior."""
        return self.told_by_data >= IDENTIFIABLE_SHARE

    @property
    def determined(self) -> Determined:
        """Return how well the data determine the value."""
        return how_determined(self.name, self.value, self.ci95, self.told_by_data)


@dataclass(frozen=True)
class Overlay:
    """A channel of a record as measured and as simulated: s, and the channel's unit."""

    channel: str
    t: FloatArray
    measured: FloatArray
    simulated: FloatArray


@dataclass(frozen=True)
class Identification:
    """Parameters with confidence, their fit to the record, and values that the data cannot determine.

    rig: the rig with the identified values. residual_rms, noise_rms: by channel, in its unit.
    fit_percent: 100 (1 - ||e|| / ||y - mean y||) by channel. models: the fitted model's response at the
    frequencies of each of `responses`. remarks: on values that are not identifiable, and on corrected stamps.
    statics: of slow ramps against a locked output. alternatives: laws that would explain a part of the
    misfit; the intervals span their estimates. coloured: channels whose residual was taken for
    coloured noise of the sensor. clocks: cost of unknown clocks of the sensors.
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
    remarks: tuple[Remark, ...] = ()
    notes: tuple[str, ...] = field(default=())
    faults: tuple[Fault, ...] = field(default=())
    alternatives: tuple[str, ...] = ()
    coloured: tuple[str, ...] = ()
    clocks: tuple[Remark, ...] = ()
    rig_choice: RigChoice = field(default_factory=RigChoice)

    @property
    def times_noise(self) -> dict[str, float]:
        """Return by channel the RMS of the residual over the noise, of the channels that a verdict uses."""
        noise = self.noise_rms
        ratios = {n: v / noise[n] for n, v in self.residual_rms.items() if noise.get(n, 0.0) > 0.0}
        return {n: r for n, r in ratios.items() if n in SENSED} or ratios

    @property
    def at_noise(self) -> bool:
        """Return whether every channel that counts is at its noise."""
        return all(ratio <= AT_NOISE for ratio in self.times_noise.values())

    @property
    def silent(self) -> tuple[str, ...]:
        """Return the sensors that measure nothing: the model was not held against them."""
        return silent_channels(self.faults)

    @property
    def verdict(self) -> Verdict:
        """Return whether the model fits the measurements, and whether they determine any value.

        A sensor that measures nothing is a misfit: the model predicts its measurement.
        """
        if not self.at_noise or self.silent:
            return "misfit"
        physical = [p for p in self.parameters if not p.name.startswith(CLOCKS)]
        is_any_determined = any(p.is_identifiable for p in physical)
        return "adequate" if is_any_determined or not physical else "not_identifiable"
