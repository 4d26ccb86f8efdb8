"""Errors of a prediction of a record."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import IdentificationError, ParameterError
from rsea_ros.model.drive import outside_gaps
from rsea_ros.model.extent import SKIPPED_START, bound_values, check_command, check_pace
from rsea_ros.model.inverse import is_inverse, motion_from, torques_along
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import FloatArray, Record


def in_phase(rig: Rig, record: Record) -> Rig:
    """Return the rig with the phases that belong to this record."""
    for place, setting in enumerate(rig.effects):
        effect = effect_named(setting.name)
        for phase in (p.name for p in effect.parameters if p.per_record):
            if effect.claims.channel in record:
                rig = _with_parameters(rig, place, {phase: _phase(rig, place, phase, record)})
    return rig


def _phase(rig: Rig, place: int, phase: str, record: Record) -> float:
    """Return the phase (rad) of A sin(w t + phase) in a record's channel.

    It is that of the residual without the wave, projected on the wave and on itself a quarter period ahead.
    """
    effect = effect_named(rig.effects[place].name)
    channel, size = effect.claims.channel, effect.main
    without = simulate(_with_parameters(rig, place, {size.name: size.null}), record)[channel]
    residual = record[channel].y - without
    keep = np.isfinite(residual)

    def share(angle: float) -> float:
        wave: FloatArray = simulate(_with_parameters(rig, place, {phase: angle}), record)[channel] - without
        return float(residual[keep] @ wave[keep])

    return math.atan2(share(0.5 * math.pi), share(0.0))


def _with_parameters(rig: Rig, place: int, parameters: Mapping[str, float]) -> Rig:
    """Return the rig with some parameters of one of its effects changed."""
    effects = list(rig.effects)
    effects[place] = replace(effects[place], parameters={**effects[place].parameters, **parameters})
    return rig.with_effects(*effects)


@dataclass(frozen=True)
class Comparison:
    """A channel at its stamps t (s): measured and predicted values in its unit, and the compared samples.

    All arrays have shape (n,).
    """

    t: FloatArray
    measured: FloatArray
    predicted: FloatArray
    counts: npt.NDArray[np.bool_]

    def __repr__(self) -> str:
        """Return the number of compared samples and the errors in one line."""
        errors = f"RMS error {self.rms_error:.4g}, fit {self.fit_percent:.2f} %"
        return f"Comparison({self.counts.sum()} of {len(self.t)} samples: {errors})"

    @property
    def rms_error(self) -> float:
        """RMS of predicted - measured, in the unit of the channel; NaN if no sample is compared."""
        if not self.counts.any():
            return math.nan
        return float(np.sqrt(np.mean((self.predicted - self.measured)[self.counts] ** 2)))

    @property
    def fit_percent(self) -> float:
        """The fit of the compared samples, %; NaN if no sample is compared."""
        if not self.counts.any():
            return math.nan
        return fit_percent((self.predicted - self.measured)[self.counts], self.measured[self.counts])


_ROUNDING = 1e-12
"""Of the largest value: a filtered constant changes by no more."""


def fit_percent(error: FloatArray, measured: FloatArray) -> float:
    """Return 100 (1 - ||e|| / ||y - mean y||), %; 0 for a measured constant."""
    if np.ptp(measured) <= _ROUNDING * float(np.max(np.abs(measured))):
        return 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(error)) / float(np.linalg.norm(measured - measured.mean())))


def predict(record: Record | Rig | str, rig: Rig | str | Record) -> Mapping[str, Comparison]:
    """Simulate a rig on the commands of a record and compare it with every measured channel.

    rig: a Rig, a file, or the name of a rig in config/rigs; the other order means the same. Returns a
    Comparison for each channel by name.
    For a rig without a spring, or a measured motion, it compares the torques along it (see inverse.py); for
    a sensor with an unknown zero it compares changes. Behind a gap of the whole record it begins anew. Where
    the rig has a condition of the record's name, that holds.
    Raises IdentificationError for a record with nothing to compare. Nothing is fitted.
    """
    record, rig = (rig, record) if isinstance(rig, Record) else (record, rig)
    if not isinstance(record, Record) or isinstance(rig, Record):
        raise ParameterError("predict: expected a Record and a rig")
    rig = load_rig(rig).under(record.source)
    record = bound_values(with_command(record, rig))
    check_command(record)
    check_pace(record)
    record = replace(record, channels={n: c for n, c in record.channels.items() if len(c)})
    if is_inverse(rig):
        motion = motion_from(record, rig)
        taken = torques_along(rig, motion)
        return {n: _comparison(motion.t, y, taken[n], motion.counts) for n, y in motion.judged.items()}
    rig = in_phase(rig, record)
    compared = {n: _comparison(record[n].t, record[n].y, y) for n, y in simulate(rig, record).items()}
    known = {n: outside_gaps(record, c.t, SKIPPED_START) for n, c in compared.items()}
    compared = {n: replace(c, counts=c.counts & known[n]) for n, c in compared.items()}
    if not compared:
        raise IdentificationError(f"{record.source}: nothing that {rig.name} measures{_why(record)}")
    return {n: _on_measured_zero(c) if rig.zero_unknown(n) else c for n, c in compared.items()}


def _why(record: Record) -> str:
    """Return which channels the reading left out, and why."""
    reasons = "; ".join(f"{f.channel}: {f.detail}" for f in record.faults if f.share == 1.0 and f.detail)
    expected = f"expected one channel of {', '.join(OUTPUTS)}: record it, or {record.naming}"
    return f" ({reasons}), {expected}" if reasons else f", {expected}"


def _on_measured_zero(c: Comparison) -> Comparison:
    if not c.counts.any():
        return c
    return replace(c, predicted=c.predicted + float(np.mean((c.measured - c.predicted)[c.counts])))


def _comparison(
    t: FloatArray, measured: FloatArray, predicted: FloatArray, known: npt.NDArray[np.bool_] | None = None
) -> Comparison:
    counts = np.isfinite(measured) & np.isfinite(t) & (t >= t[0] + SKIPPED_START)
    return Comparison(t, measured, predicted, counts if known is None else counts & known)
