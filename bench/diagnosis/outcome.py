"""The outcome of one case: the diagnosis beside the truth, as plain values that go into a JSON file."""

from __future__ import annotations

import time
import traceback
from dataclasses import dataclass, field, replace
from math import nan, prod

from independent.hidden import BESIDE_THE_CONTRACT, MAIN_PARAMETER

from bench.diagnosis.cases import Case
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record
from rsea_ros.report.remark_words import remark_sentences

ERROR = "error"
OUTSIDE = ("off_catalogue", "taken_out", "unsearched")
"""Groups whose effect the diagnosis does not have, or does not try unless a rig states it."""


@dataclass(frozen=True)
class Found:
    """The true value of a parameter and the one of the diagnosis, in SI."""

    effect: str
    parameter: str
    truth: float
    value: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Error relative to the truth; absolute where the truth is zero."""
        return abs(self.value - self.truth) / (abs(self.truth) or 1.0)

    @property
    def main(self) -> bool:
        return _main_parameter(self.effect) == self.parameter

    @property
    def covered(self) -> bool:
        return self.low <= self.truth <= self.high


def _main_parameter(effect: str) -> str:
    return MAIN_PARAMETER.get(effect) or next(iter(BESIDE_THE_CONTRACT[effect][0]))


@dataclass(frozen=True)
class Outcome:
    """One case. times_noise: worst channel's held-out residual over its noise; memory in MB."""

    name: str
    group: str
    truth: tuple[str, ...]
    named: tuple[str, ...]
    verdict: str
    confusable: tuple[str, ...] = ()
    found: tuple[Found, ...] = ()
    faults: tuple[str, ...] = ()
    faults_found: tuple[str, ...] = ()
    mimics: tuple[str, ...] = ()
    gain: float = nan
    gain_fresh: float = nan
    times_noise: float = nan
    times_noise_fresh: float = nan
    seconds: float = nan
    statuses: tuple[str, ...] = ()
    error: str = ""
    statements: tuple[str, ...] = field(default=())

    @property
    def right(self) -> bool:
        """The first cause for one hidden effect, both in any order for two, none for none; and the fault."""
        if self.error or not set(self.faults) <= set(self.faults_found):
            return False
        if self.group == "clean":
            return not self.named and self.verdict == "nothing_wrong"
        if self.group in OUTSIDE:
            return not self.named and (self.verdict != "nothing_wrong" or bool(self.faults_found))
        return set(self.named[: max(len(self.truth), 1)]) == set(self.truth)

    @property
    def right_or_rival(self) -> bool:
        """The same, when a cause that the first is said to be confusable with counts as well."""
        lenient = len(self.truth) == 1 and self.truth[0] in self.named[:1] + self.confusable
        mimic = self.group in OUTSIDE and set(self.named) <= set(self.mimics)
        return self.right or (not self.error and (lenient or mimic))


def run_case(
    case: Case, rig_name: str = "paper_high_impedance", settings: DiagnosisSettings = DEFAULT
) -> Outcome:
    """Diagnose a case and compare the result with the truth; an exception is an outcome too."""
    start = time.perf_counter()
    try:
        settings = replace(settings, without=case.without)
        diagnosis = diagnose([case.record], load_rig(rig_name), settings=settings)
    except Exception:
        told = traceback.format_exc(limit=-3)
        named = ()
        seconds = time.perf_counter() - start
        return Outcome(case.name, case.group, case.truth_causes, named, ERROR, seconds=seconds, error=told)
    return _outcome(case, diagnosis, time.perf_counter() - start)


def _outcome(case: Case, diagnosis: Diagnosis, seconds: float) -> Outcome:
    causes = diagnosis.causes
    channel = causes[0].channel if causes else "ft"
    return Outcome(
        name=case.name,
        group=case.group,
        truth=() if case.group in OUTSIDE else tuple(case.truth_causes),
        named=tuple(cause.name for cause in causes),
        verdict=diagnosis.verdict,
        statuses=tuple(cause.status for cause in causes),
        confusable=tuple(causes[0].confusable_with) if causes else (),
        found=tuple(_estimates(case, diagnosis)),
        faults=case.faults,
        faults_found=tuple(sorted({fault.kind for fault in diagnosis.faults})),
        mimics=case.mimics,
        gain=1.0 - prod(1.0 - c.gain_holdout for c in causes if c.channel == channel) if causes else nan,
        gain_fresh=_fresh_gain(diagnosis, case.fresh_record, channel) if causes else nan,
        times_noise=_worst(diagnosis.extended_residual_rms, diagnosis.noise_rms),
        times_noise_fresh=_worst(_errors(diagnosis.extended_rig, case.fresh_record), diagnosis.noise_rms),
        seconds=seconds,
        statements=remark_sentences(diagnosis.remarks),
    )


def _estimates(case: Case, diagnosis: Diagnosis):
    """Yield every true parameter of the causes that were named rightly."""
    for cause in diagnosis.causes:
        for name, truth in case.truth_parameters.get(cause.name, {}).items():
            if name in cause.parameters:
                estimate = cause.parameters[name]
                yield Found(cause.name, name, truth, estimate.value, *estimate.ci95)


def _errors(rig: Rig, record: Record | None) -> dict[str, float]:
    return {k: v.rms_error for k, v in predict(rig, record).items()} if record else {}


def _fresh_gain(diagnosis: Diagnosis, record: Record | None, channel: str) -> float:
    """Return 1 - RMS(extended) / RMS(baseline) on a record that the diagnosis has not seen."""
    before, after = (_errors(rig, record) for rig in (diagnosis.baseline_rig, diagnosis.extended_rig))
    return 1.0 - after[channel] / before[channel] if channel in before else nan


def _worst(residual, noise) -> float:
    return max((residual[k] / noise[k] for k in residual if noise.get(k)), default=nan)
