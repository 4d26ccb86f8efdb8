"""What a diagnosis says, in words and numbers for people; page and terminal say the same."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from rsea_ros.diagnosis.result import Cause, Diagnosis, Estimate, Fault, Misfit
from rsea_ros.report import words
from rsea_ros.signals import UNITS

_PROPER = {"coulomb": "Coulomb", "stribeck": "Stribeck", "ft": "F/T"}
_ORDER = ("ft", "position", "velocity", "motor_torque")
_RESPECTS = {
    "frequency_band": "frequency",
    "amplitude": "load",
    "velocity": "speed",
    "time": "time",
    "angle": "rotor angle",
}


def main_channel(diagnosis: Diagnosis) -> str:
    """Return the channel that verdict and gain speak of."""
    if diagnosis.causes:
        return diagnosis.causes[0].channel
    return next(n for n in (*_ORDER, *diagnosis.residual_rms) if n in diagnosis.residual_rms)


def effect(name: str) -> str:
    """Return the plain name of an effect, as it stands within a sentence."""
    return " ".join(_PROPER.get(word, word) for word in name.split("_"))


def respect(what: str) -> str:
    """Return the plain name of what a residual is laid out against."""
    return _RESPECTS.get(what, what.replace("_", " "))


def prose(text: str) -> str:
    """Return a sentence with plain names of effects, `coulomb_friction` as `Coulomb friction`."""
    return re.sub(r"[a-z]+(?:_[a-z]+)+", lambda match: effect(match[0]), text)


def size(cause: Cause) -> str:
    """Return a cause's main parameter, `3.00 N·m`, or with its name where it has no unit."""
    name, estimate = next(iter(cause.parameters.items()))
    number = words.quantity(estimate.value, estimate.unit, 3)
    return number if estimate.unit != "1" else f"{name.replace('_', ' ')} {number}"


def named(causes: Sequence[Cause]) -> str:
    """Return causes with their sizes: `Coulomb friction (3.00 N·m) and backlash (1.20 mrad)`."""
    return words.listed([f"{effect(c.name)} ({size(c)})" for c in causes])


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict as one short sentence."""
    d, n = diagnosis, main_channel(diagnosis)
    channel, (before, _) = words.channel(n), times_noise(d, n)
    if d.verdict == "nothing_wrong":
        return "Nothing is wrong with the simulation: its values fitted, only sensor noise is left"
    if d.verdict == "unexplained":
        size = f"{_times(before)} the noise"
        return f"The {channel} residual is {size}, and nothing in the catalogue explains it"
    is_, it, explains = ("is", "it", "explains") if len(d.causes) == 1 else ("are", "them", "explain")
    rest = f"{explains} a part of what the simulation gets wrong; the rest stays unexplained"
    if d.verdict == "explained":
        rest = f"{is_} what the simulation lacks; with {it}, only noise is left"
    return words.sentence(f"{named(d.causes)} {rest}")


def times_noise(diagnosis: Diagnosis, channel: str) -> tuple[float, float]:
    """Return the held-out residual of a channel over its noise, before and after."""
    noise = diagnosis.noise_rms.get(channel, np.nan) or np.nan
    return diagnosis.residual_rms[channel] / noise, diagnosis.extended_residual_rms[channel] / noise


def gain(diagnosis: Diagnosis, channel: str) -> float:
    """Return the gain of all causes together: 1 - RMS(residual after) / RMS(residual before), held out."""
    before = diagnosis.residual_rms[channel]
    return 1.0 - diagnosis.extended_residual_rms[channel] / before if before > 0.0 else 0.0


def percent(share: float, digits: int = 1) -> str:
    """Return a share as `97.3 %`, with a minus sign that is one."""
    return f"{100.0 * share:.{digits}f} %".replace("-", "−") if np.isfinite(share) else "–"


def percent_range(interval: tuple[float, float]) -> str:
    """Return an interval of shares as `97.1 to 97.5 %`."""
    low, high = (f"{100.0 * side:.1f}".replace("-", "−") for side in interval)
    return f"{low} to {high} %"


def residual_change(diagnosis: Diagnosis, channel: str) -> str:
    """Return `36.8 → 0.99`: the residual over the noise, before and after; once where nothing has changed."""
    before, after = (words.number(v, 3 if v >= 1.0 else 2) for v in times_noise(diagnosis, channel))
    return f"{before} → {after}" if diagnosis.causes else before


def rms_change(diagnosis: Diagnosis, channel: str) -> str:
    """Return the same as RMS in the channel's unit beside the noise."""
    before, after, noise = (
        words.quantity(v[channel], UNITS[channel])
        for v in (diagnosis.residual_rms, diagnosis.extended_residual_rms, diagnosis.noise_rms)
    )
    return f"{before} → {after}, noise {noise}" if diagnosis.causes else f"{before}, noise {noise}"


def estimate(estimate: Estimate) -> tuple[str, str, str]:
    """Return value, half-width of the 95 % interval and unit: ("4.0045", "0.0029", "mrad")."""
    factor, prefix = _prefix(estimate)
    low, high = estimate.ci95
    value, half = words.with_interval(estimate.value * factor, low * factor, high * factor)
    return value, half, prefix + words.unit(estimate.unit)


def _prefix(estimate: Estimate) -> tuple[float, str]:
    """Return the factor and prefix that make a small angle or time readable."""
    if estimate.unit not in ("rad", "s") or not 0.0 < abs(estimate.value) < 0.1:
        return 1.0, ""
    return (1e3, "m") if abs(estimate.value) >= 1e-3 else (1e6, "µ")


def misfit(m: Misfit) -> str:
    """Return `speed −0.02 to 0 rad/s (48 times)`."""
    low, high = (words.number(side, 2) for side in (m.low, m.high))
    return f"{respect(m.what)} {low} to {high} {words.unit(m.unit)} ({_times(m.times_noise)})"


def fault(f: Fault) -> str:
    """Return `outliers in F/T torque, 0.04 % of the samples`."""
    if f.kind == "missing_topic":
        return f"{words.channel(f.channel)} is missing"
    detail = f" ({f.detail})" if f.detail else ""
    share = f"{words.number(100.0 * f.share, 2)} % of the samples"
    return f"{_kind(f)} in {words.channel(f.channel)}, {share}{detail}"


def faults(items: Sequence[Fault]) -> str:
    """Return all faults in a short sentence."""
    kinds: dict[str, list[str]] = {}
    for f in items:
        kinds.setdefault(f.channel, []).append(_kind(f))
    parts = [f"{words.listed(k)} in {words.channel(n)}" for n, k in kinds.items()]
    return f"Faults in the data, masked: {'; '.join(parts)}."


def _kind(f: Fault) -> str:
    return "NaN" if f.kind == "nan" else f.kind.replace("_", " ")


def confusions(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each cause that these data cannot tell from others."""
    return [
        words.sentence(f"{effect(c.name)}: these data do not tell it from {_either(c.confusable_with)}.")
        for c in diagnosis.causes
        if c.confusable_with
    ]


def excitation(settings: Mapping[str, float | str]) -> str:
    """Return `chirp, amplitude 64.3 N·m, 0.05 to 120 Hz, 12 s` of an experiment; what has no unit as it stands."""
    known = {k: v if isinstance(v, str) else f"{v:.3g}" for k, v in settings.items()}
    parts = [known.pop("kind", "")]
    torque = words.unit(known.pop("unit", "N m"))
    parts += [f"{k} {known.pop(k)} {torque}" for k in ("amplitude", "noise") if k in known]
    if {"low", "high"} <= set(known):
        parts.append(f"{known.pop('low')} to {known.pop('high')} Hz")
    parts += [f"{known.pop('duration')} s"] if "duration" in known else []
    return ", ".join(filter(None, [*parts, *(f"{k.replace('_', ' ')} {v}" for k, v in known.items())]))


def _either(names: Sequence[str]) -> str:
    return words.listed([effect(n) for n in names]).replace(" and ", " or ")


def _times(ratio: float) -> str:
    return f"{words.number(ratio, 2 if ratio < 100.0 else 3)} times"
