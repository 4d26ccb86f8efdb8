"""Numbers of a diagnosis as people read them: residuals over the noise, gains, sizes with their doubt."""

import math

import numpy as np

from rsea_ros.diagnosis.result import Cause, CauseParameter, Diagnosis
from rsea_ros.documents.units import in_motion
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.records.record import UNITS
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words

_END = 0.99
"""Share of the upper bound from which a value stands for infinity."""


def times_noise(diagnosis: Diagnosis, channel: str) -> tuple[float, float]:
    """Return the held-out residual of a channel over its noise, before and after."""
    noise = diagnosis.noise_rms.get(channel, np.nan) or np.nan
    return diagnosis.residual_rms[channel] / noise, diagnosis.extended_residual_rms[channel] / noise


def left_channel(diagnosis: Diagnosis) -> str:
    """Return the worst channel above the noise where the main one has reached it; empty for none."""
    after = {n: times_noise(diagnosis, n)[1] for n in diagnosis.extended_residual_rms}
    reached = diagnosis.settings.floor.reached
    if diagnosis.at_noise_floor or not after[diagnosis.channel] <= reached:
        return ""
    worst = max(after, key=lambda n: after[n] if after[n] > reached else 0.0)
    return worst if after[worst] > reached else ""


def gain(diagnosis: Diagnosis, channel: str) -> float:
    """Return the gain of all causes together: 1 - RMS(residual after) / RMS(residual before), held out."""
    before = diagnosis.residual_rms[channel]
    return 1.0 - diagnosis.extended_residual_rms[channel] / before if before > 0.0 else 0.0


def percent(share: float, digits: int = 1) -> str:
    """Return a share as `97.3 %`, with a minus sign that is one; below −100 % as `< −100 %`."""
    return f"{_percents(share, digits)} %" if np.isfinite(share) else "–"


def _percents(share: float, digits: int) -> str:
    """Return a share in percent; a residual that more than doubles is no gain, whatever its size."""
    return words.minus(f"{100.0 * share:.{digits}f}" if share >= -1.0 else "< -100")


def percent_range(interval: tuple[float, float]) -> str:
    """Return an interval of shares as `97.1 to 97.5 %`."""
    low, high = (_percents(side, 1) for side in interval)
    return f"{low} to {high} %"


def residual_change(diagnosis: Diagnosis, channel: str) -> str:
    """Return `36.8 → 0.99`: the residual over the noise, before and after; once where nothing has changed."""
    before, after = (words.number(v, 3 if v >= 1.0 else 2) for v in times_noise(diagnosis, channel))
    return f"{before} → {after}" if diagnosis.causes else before


def rms_change(diagnosis: Diagnosis, channel: str) -> str:
    """Return the same as RMS in the channel's unit beside the noise."""
    before, after, noise = (
        words.quantity(v[channel], in_motion(UNITS[channel], linear=diagnosis.baseline_rig.linear))
        for v in (diagnosis.residual_rms, diagnosis.extended_residual_rms, diagnosis.noise_rms)
    )
    return f"{before} → {after}, noise {noise}" if diagnosis.causes else f"{before}, noise {noise}"


def sizes(cause: Cause) -> dict[str, CauseParameter]:
    """Return the parameters that say how large a cause is.

    One that would be infinite is left out: a drift that is a straight line has no time constant.
    """
    effect = catalogue().get(cause.name)
    ends = {p.name: p.high for p in effect.parameters if p.optional and math.isinf(p.null)} if effect else {}
    return {n: p for n, p in cause.parameters.items() if p.value < _END * ends.get(n, math.inf)}


def model_half_width(estimate: CauseParameter) -> str:
    """Return the half-width of the simulation's own error at 95 % with its unit: `0.0147 N·m`."""
    factor, unit = words.unit_factor(estimate.value, estimate.unit)
    return f"{words.number(Z95 * estimate.model_sd * factor, 2)} {unit}".rstrip()
