"""Words and numbers of a diagnosis, the same for page and terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from rsea_ros.diagnosis.result import Cause, Diagnosis, Misfit, Reason, Rejected
from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import is_unexcited, silent_channels
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.rig.words import values_off

_REASONS: Mapping[Reason, str] = {
    "far_behind": "much worse than the best effect on the training data",
    "at_bound": "its fitted size is at the bound of the effect, or within a clock's error of nothing",
    "not_sure": "does not certainly lower the residual of held-out data",
    "too_small": "lowers the residual of held-out data, but by too little",
    "leaves_priors": "gains less than it costs to leave the rig's values so far outside their stated doubt",
    "explains_less": "{rival} explains more",
    "no_better_than_simpler": "no better than {rival}, which is simpler",
    "no_better_than_likelier": "no better than {rival}, which agrees better with the priors",
    "redundant": "not needed in addition to the other causes",
    "replaced": "replaced by another effect after later causes were added",
    "improbable": "helps, but its law does not fit the data: probability {probability:.2f}",
    "leaves_too_much": "helps, but leaves so much that it may replace another effect",
}
_RESPECTS = {
    "frequency_band": "frequency",
    "amplitude": "load",
    "velocity": "speed",
    "time": "time",
    "angle": "rotor angle",
}


def rejection(rejected: Rejected) -> str:
    """Return the reason for a rejection, as part of a sentence."""
    probability = rejected.probability or 0.0
    return _REASONS[rejected.reason].format(rival=rejected.rival, probability=probability)


def respect(quantity: str) -> str:
    """Return the plain name of the quantity of a residual profile."""
    return _RESPECTS.get(quantity, quantity.replace("_", " "))


def prose(text: str) -> str:
    """Return a sentence with plain names of effects, `coulomb_friction` as `Coulomb friction`."""
    return re.sub(r"[a-z]+(?:_[a-z]+)+", lambda match: words.effect(match[0]), text)


def size(cause: Cause) -> str:
    """Return the main parameter of a cause, `3.00 N·m`, with its name if it has no unit."""
    name, estimate = next(iter(cause.parameters.items()))
    number = words.quantity(estimate.value, estimate.unit, 3)
    return number if estimate.unit != "1" else f"{name.replace('_', ' ')} {number}"


def cause_list(causes: Sequence[Cause]) -> str:
    """Return causes with their sizes: `Coulomb friction (3.00 N·m) and backlash (1.20 mrad)`."""
    return list_names([f"{words.effect(c.name)} ({size(c)})" for c in causes])


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict as one short sentence, and how many values are not the rig's."""
    return "; ".join(filter(None, (_verdict(diagnosis), values_off(diagnosis.remarks))))


def _verdict(diagnosis: Diagnosis) -> str:
    d, n = diagnosis, diagnosis.channel
    channel, (before, _) = words.channel(n), num.times_noise(d, n)
    silent = [words.channel(name) for name in silent_channels(d.faults)]
    if d.verdict == "unexplained" and silent and d.at_noise_floor:
        return (
            f"{words.sentence(list_names(silent))} measures nothing; in the other channels only noise is left"
        )
    if d.verdict == "nothing_wrong" and is_unexcited(d.faults):
        return "These data show nothing: the command never changes, so no cause could be seen"
    if d.verdict == "nothing_wrong" and values_off(d.remarks):
        return "The structure of the simulation fits: with fitted values, only sensor noise is left"
    if d.verdict == "nothing_wrong":
        return "Nothing is wrong with the simulation: with fitted values, only sensor noise is left"
    if d.verdict == "unexplained":
        near = f"{math.ceil(100.0 * before) / 100.0:.2f} times"  # never rounded down to the floor
        size = f"{near if before < 2.0 else _times(before)} the noise"
        return f"The {channel} residual is {size}, and no effect of the catalogue explains it"
    explains = "explains" if len(d.causes) == 1 else "explain"
    if d.verdict == "explained":
        rest = f"{explains} the misfit; only noise is left"
    elif d.at_noise_floor:
        rest = f"probably {explains} the misfit; only noise is left"
    else:
        rest = f"{explains} part of the misfit; the rest stays unexplained"
    return words.sentence(f"{cause_list(d.causes)} {rest}")


def misfit(m: Misfit) -> str:
    """Return `speed −20 to 0 mrad/s (48 times)`."""
    return f"{respect(m.what)} {words.span(m.low, m.high, m.unit)} ({_times(m.times_noise)})"


def confusions(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each cause that these data do not distinguish from others."""
    return [
        words.sentence(
            f"{words.effect(c.name)}: these data do not distinguish it from {_either(c.confusable_with)}."
        )
        for c in diagnosis.causes
        if c.confusable_with
    ]


_BY_THE_WAY = ("rate", "seed", "period")
"""Settings of an experiment that matter only to the command that plays it."""


def excitation(settings: Mapping[str, float | str]) -> str:
    """Return `chirp, amplitude 64.3 N·m, 0.05 to 120 Hz, 12 s` of an experiment."""
    known = {k: v if isinstance(v, str) else f"{v:.3g}" for k, v in settings.items() if k not in _BY_THE_WAY}
    parts = [known.pop("kind", "")]
    torque = words.unit(known.pop("unit", "N m"))
    parts += [f"{k} {known.pop(k)} {torque}" for k in ("amplitude", "noise", "peak") if k in known]
    if {"low", "high"} <= set(known):
        parts.append(f"{known.pop('low')} to {known.pop('high')} Hz")
    parts += [f"{known.pop('duration')} s"] if "duration" in known else []
    return ", ".join(filter(None, [*parts, *(f"{k.replace('_', ' ')} {v}" for k, v in known.items())]))


def _either(names: Sequence[str]) -> str:
    return list_names([words.effect(n) for n in names], "or")


def _times(ratio: float) -> str:
    return f"{words.number(ratio, 2 if ratio < 100.0 else 3)} times"
