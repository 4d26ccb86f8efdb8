"""The result of a diagnosis as values, for reports and files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.identification.result import Overlay, ParameterEstimate, Remark
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import Fault, FloatArray

Verdict = Literal["nothing_wrong", "explained", "partly_explained", "unexplained"]
Reason = Literal[
    "far_behind",
    "at_bound",
    "not_sure",
    "too_small",
    "leaves_priors",
    "explains_less",
    "no_better_than_simpler",
    "no_better_than_likelier",
    "redundant",
    "replaced",
    "improbable",
    "leaves_too_much",
]
"""Why an effect is no cause.

far_behind: of the best, on the data of the fit. at_bound: its main parameter ran to its bound, or is a time
that a clock's error may make. not_sure, too_small: the gain on the validation blocks. leaves_priors: needs
values of the rig so far outside their stated doubt that the gain does not pay for it. explains_less,
no_better_than_…: than the accepted rival.
redundant: beside the other causes. replaced: it was accepted, and gave way later. improbable: it was
accepted, but its law does not fit what it takes away. leaves_too_much: it was, but does not surely help.
"""
Status = Literal["confirmed", "leading", "one_of"]
"""confirmed: right beyond reasonable doubt. leading: surely helps, part of the truth, and more is missing.
one_of: it or one of the alternatives that stand against it.
"""


@dataclass(frozen=True)
class Misfit:
    """Where a model and the data part: from … to (unit) of `what`, and how many times the noise."""

    what: str
    low: float
    high: float
    unit: str
    times_noise: float
    channel: str


@dataclass(frozen=True)
class CauseParameter:
    """A parameter of a cause with its 95 % interval.

    ci95: of all that is unknown, the simulation's own error included. statistical_ci95: of the data's noise
    alone; None where it was not separated. model_sd: one sigma of the simulation's own error, in `unit`.
    """

    value: float
    unit: str
    ci95: tuple[float, float]
    statistical_ci95: tuple[float, float] | None = None
    model_sd: float = 0.0


@dataclass(frozen=True)
class Cause:
    """An accepted cause. gain_…: 1 - RMS(residual with it) / RMS(residual without it), of `channel`.

    times_noise: held-out residual of the channel over its noise, without and with it.
    probability: that it is part of the truth under this name, 0 to 1, calibrated (bench/calibration).
    """

    name: str
    parameters: Mapping[str, CauseParameter]
    gain_train: float
    gain_holdout: float
    gain_holdout_ci95: tuple[float, float]
    times_noise: tuple[float, float]
    equation: str = ""
    channel: str = "ft"
    confusable_with: tuple[str, ...] = ()
    status: Status = "confirmed"
    probability: float = 1.0


@dataclass(frozen=True)
class Alternative:
    """An effect that may be right in a cause's place, with its size; gain_…: held out, of `channel`."""

    name: str
    instead_of: str
    parameters: Mapping[str, CauseParameter]
    gain_holdout: float
    gain_holdout_ci95: tuple[float, float]
    channel: str
    probability: float


@dataclass(frozen=True)
class Rejected:
    """An effect that was tried and is no cause, with its gain on data that it was not fitted to.

    rival: the effect that was preferred, empty for none. is_fitted: fitted to all training blocks; otherwise
    only to short pieces of them, and its gain says little. probability: where it was weighed as a cause.
    """

    name: str
    gain_holdout: float
    reason: Reason
    rival: str = ""
    is_fitted: bool = True
    probability: float | None = None


ExperimentReason = Literal["separates", "inseparable", "other_amplitude", "amplitude_series"]
"""Why a run is recommended, or none.

separates: it distinguishes a cause from its rivals. inseparable: no run within the limits does.
other_amplitude: a run at another amplitude would show more of them; none can be simulated. amplitude_series:
at a multiple of the amplitude it shows whether what is left is linear.
"""


@dataclass(frozen=True)
class Experiment:
    """The run that would decide between a cause and its rivals; `excitation` is empty without one.

    cause, rivals: not distinguished by these data. separation: residual of the rivals over the
    noise; an upper bound where nothing separates them. amplitude: of the run, relative to the present one.
    """

    reason: ExperimentReason
    cause: str = ""
    rivals: tuple[str, ...] = ()
    separation: float = 0.0
    amplitude: float = 1.0
    excitation: Mapping[str, float | str] = field(default_factory=dict)


EditOutcome = Literal["survived", "still_there", "worse", "undecided"]
"""survived: without the cause, the model predicts the edited machine as well as its own, and better than with
it. still_there: with the cause it does. worse: better without it, yet not as well: name or size are wrong, or
more was changed. undecided: neither, and no better without it: another machine, or more was changed.
"""


@dataclass(frozen=True)
class Edit:
    """RMS errors of predictions of a run of the edited machine, in the unit of `channel`.

    error_before: of the extended model; error_after: with `cause` deleted and nothing fitted;
    error_dense_fit: of the rig with every value fitted and no cause. own_error: of the extended model on
    held-out data of its own machine. source, faults: of the run.
    """

    cause: str
    source: str
    channel: str
    unit: str
    noise: float
    error_before: float
    error_after: float
    error_dense_fit: float
    own_error: float
    faults: tuple[Fault, ...] = ()

    @property
    def outcome(self) -> EditOutcome:
        """What the run says of the name."""
        enough = SAME * self.own_error
        if self.error_after < self.error_before:
            return "survived" if self.error_after <= enough else "worse"
        return "still_there" if self.error_before <= enough else "undecided"

    @property
    def survived(self) -> bool:
        """Whether the name survives its removal."""
        return self.outcome == "survived"


SAME = 1.2
"""Ratio of the errors of two runs that one model predicts equally well."""


@dataclass(frozen=True)
class SmallestChange:
    """The size, in `unit`, of an effect that a recording would just have shown; NaN for none within reach."""

    name: str
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True)
class Spectrum:
    """Amplitude spectral densities of a channel's residual: Hz; unit/sqrt(Hz)."""

    channel: str
    frequency: FloatArray
    before: FloatArray
    after: FloatArray
    noise: float


@dataclass(frozen=True)
class Diagnosis:
    """The verdict and its basis. Dicts are by channel, in the channel's unit.

    channel: the main one, of verdict, misfits and the gains of rejected effects.
    baseline: values of the nominal model; extended: those of the extended one, its effects included.
    residual_rms: of the re-fitted nominal model; extended_residual_rms: of the extended one; both held out.
    remarks: on values that the data cannot determine, and others for the reader.
    before, after, masked: of the first record; masked: which samples of `before` do not count, by channel,
    shape (n,): the faulty ones, and those before the bench has settled.
    """

    verdict: Verdict
    channel: str
    rig_name: str
    sources: tuple[str, ...]
    duration: float
    rate: float
    faults: tuple[Fault, ...]
    baseline_rig: Rig
    baseline: tuple[ParameterEstimate, ...]
    extended_rig: Rig
    extended: tuple[ParameterEstimate, ...]
    noise_rms: Mapping[str, float]
    residual_rms: Mapping[str, float]
    fit_percent: Mapping[str, float]
    extended_residual_rms: Mapping[str, float]
    extended_fit_percent: Mapping[str, float]
    at_noise_floor: bool
    misfit: tuple[Misfit, ...]
    causes: tuple[Cause, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    remaining: tuple[Misfit, ...] = ()
    next_experiment: Experiment | None = None
    before: tuple[Overlay, ...] = ()
    after: tuple[Overlay, ...] = ()
    spectra: tuple[Spectrum, ...] = ()
    remarks: tuple[Remark, ...] = ()
    masked: Mapping[str, npt.NDArray[np.bool_]] = field(default_factory=dict)
    settings: DiagnosisSettings = DEFAULT
    rig_choice: RigChoice = field(default_factory=RigChoice)
    edit: Edit | None = None
    smallest: tuple[SmallestChange, ...] = ()

    @property
    def why_stopped(self) -> Literal["only_noise", "most_causes", "nothing_better"]:
        """Why the search for causes ended, as the final model shows it."""
        if self.at_noise_floor:
            return "only_noise"
        return "most_causes" if len(self.causes) >= self.settings.max_causes else "nothing_better"

    @property
    def final(self) -> tuple[ParameterEstimate, ...]:
        """The rig's own values in the extended model: those of `baseline` compensate the missing causes."""
        extended = {p.name: p for p in self.extended}
        return tuple(extended.get(p.name, p) for p in self.baseline)
