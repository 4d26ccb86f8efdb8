"""A diagnosis in sentences: verdict, certainty and evidence of causes, rejections, the next run."""

import math
import re
from collections.abc import Mapping, Sequence

from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Experiment, Misfit, Reason, Rejected
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.result import is_unexcited, silent_channels
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.remark_words import found_faults
from rsea_ros.report.rig import values_off

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
_CERTAINTY = {
    "confirmed": "the simulation certainly lacks it",
    "leading": "it certainly helps on held-out data, but part of the misfit remains",
    "one_of": "these data do not distinguish them",
}
_RESPECTS = {"frequency_band": "frequency", "amplitude": "load", "velocity": "speed", "angle": "rotor angle"}
_BY_THE_WAY = ("rate", "seed", "period")
"""Settings of an experiment that matter only to the command that plays it."""


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict as one short sentence, and how many values are not the rig's."""
    return "; ".join(filter(None, (_verdict(diagnosis)[0], values_off(diagnosis.remarks))))


def diagnosis_sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict with its numbers, values that are not the rig's, and faults of the data."""
    off = words.sentence(values_off(diagnosis.remarks))
    return f"{_verdict(diagnosis)[1]}.{f' {off}.' if off else ''}{found_faults(diagnosis.faults, str)}"


def _verdict(d: Diagnosis) -> tuple[str, str]:
    """Return the verdict as a title, and as a sentence with numbers."""
    name, (before, after) = words.channel(d.channel), num.times_noise(d, d.channel)
    at_floor = f"re-fitted the {name} residual is at the noise floor ({after:.2f} times the noise)"
    silent = list_names([words.channel(n) for n in silent_channels(d.faults)])
    if d.verdict == "nothing_wrong" and is_unexcited(d.faults):
        text = "These data show nothing: the command never changes, so no cause could be seen"
        return text, text
    if d.verdict == "nothing_wrong":
        fine = "The structure of the {} fits" if values_off(d.remarks) else "Nothing is wrong with the {}"
        title = f"{fine.format('simulation')}: with fitted values, only sensor noise is left"
        return title, f"{fine.format('model')}: with its values {at_floor}"
    if d.verdict == "unexplained" and silent and d.at_noise_floor:
        title = f"{words.sentence(silent)} measures nothing; in the other channels only noise is left"
        return title, f"The {silent} measures nothing and is left out; with the model's values {at_floor}"
    if d.verdict == "unexplained":
        near = (
            f"{math.ceil(100.0 * before) / 100.0:.2f}" if before < 2.0 else ""
        )  # never rounded to the floor
        said = (
            f"{near or _digits(before)} times the noise, and no effect of the catalogue explains it",
            f"{near or f'{before:.1f}'} times the noise; no known effect explains it",
        )
        return f"The {name} residual is {said[0]}", f"The {name} residual is {said[1]}"
    explains, pronoun = ("explain", "them") if len(d.causes) > 1 else ("explains", "it")
    if d.verdict == "explained":
        how, rest, end = f"{explains} the misfit", "only noise is left", ", which is the floor"
    elif d.at_noise_floor:
        how, rest, end = (
            f"probably {explains} the misfit",
            "only noise is left",
            ", but another law may do the same",
        )
    else:
        how, rest, end = f"{explains} part of the misfit", "the rest stays unexplained", "; " + _rest(d)
    left = f"{after:.2f}" if d.at_noise_floor or d.verdict == "explained" else _near(after)
    named = list_names([words.effect(c.name) for c in d.causes])
    falls = f"falls from {before:.1f} to {left}" if after < before else f"stays at {left}"
    fall = f"with {pronoun} the {name} residual {falls} times the noise"
    return words.sentence(f"{cause_list(d.causes)} {how}; {rest}"), words.sentence(
        f"{named} {how}: {fall}{end}"
    )


def _rest(d: Diagnosis) -> str:
    left = num.left_channel(d)
    stays = f"stays at {_near(num.times_noise(d, left)[1])} times the noise" if left else ""
    return f"the {words.channel(left)} residual {stays}" if left else "the rest stays unexplained"


def _near(ratio: float) -> str:
    """Return a ratio near the floor with two digits behind the point."""
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.1f}"


def _digits(ratio: float) -> str:
    return words.number(ratio, 2 if ratio < 100.0 else 3)


def cause_list(causes: Sequence[Cause]) -> str:
    """Return causes with their main size: `Coulomb friction (3.00 N·m) and backlash (1.20 mrad)`.

    A size whose interval has both signs is open.
    """
    shown = []
    for cause in causes:
        name, p = next(iter(cause.parameters.items()))
        label = f"{name.replace('_', ' ')} " if p.unit == "1" else ""
        known = p.ci95[0] * p.ci95[1] >= 0.0 and p.ci95[0] < p.ci95[1] < math.inf
        size = f"{label}{words.quantity(p.value, p.unit, 3)}" if known else "size open"
        shown.append(f"{words.effect(cause.name)} ({size})")
    return list_names(shown)


def status_line(cause: Cause, alternatives: Sequence[Alternative] = (), at_floor: bool = False) -> str:
    """Return `leading: command_delay 9.10 ms [8.40, 9.80], probability 0.87; …` of a cause.

    alternatives: of the whole diagnosis. at_floor: the residual with all causes is noise.
    """
    rivals = [a for a in alternatives if a.instead_of == cause.name]
    rivals.sort(key=lambda a: -a.probability)
    named: list[Cause | Alternative] = [cause, *rivals]
    items = [f"{_size(item)}, probability {item.probability:.2f}" for item in named]
    reason = _CERTAINTY[cause.status]
    if at_floor and cause.status == "leading":
        reason = "it reduces the residual to the noise, but another law may do the same"
    elif cause.status == "leading" and cause.gain_holdout_ci95[0] <= 0.0:
        reason = "by itself it may gain nothing on held-out data"
    if cause.status == "one_of" and rivals:
        return f"one of: {list_names(items, 'or')}; {reason}"
    text = f"{cause.status.replace('_', ' ')}: {items[0]}; {reason}"
    return f"{text}; less likely instead: {list_names(items[1:], 'or')}" if rivals else text


def _size(item: Cause | Alternative) -> str:
    """Return name and main parameter with its 95 % interval: `command_delay 9.10 ms [8.40, 9.80]`."""
    if not item.parameters:
        return item.name
    p = next(iter(item.parameters.values()))
    factor, unit = words.unit_factor(p.value, p.unit)
    value, low, high = (words.number(v * factor) for v in (p.value, *p.ci95))
    return f"{item.name} {value}{f' {unit}' if unit else ''} [{low}, {high}]"


def evidence(cause: Cause) -> str:
    """Return the evidence for a cause as one sentence."""
    before, after = cause.times_noise
    return (
        f"With {effect_named(cause.name).about}, the {words.channel(cause.channel)} residual of data that "
        f"took no part falls from {before:.2f} to {after:.2f} times the noise (gain "
        f"{words.minus(f'{100.0 * cause.gain_holdout:.1f}')} %)."
    )


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


def misfit(m: Misfit) -> str:
    """Return `speed −20 to 0 mrad/s (48 times)`."""
    return f"{respect(m.what)} {words.span(m.low, m.high, m.unit)} ({_digits(m.times_noise)} times)"


def confusions(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each cause that these data do not distinguish from others."""
    return [
        words.sentence(
            f"{words.effect(c.name)}: these data do not distinguish it from "
            f"{list_names([words.effect(n) for n in c.confusable_with], 'or')}."
        )
        for c in diagnosis.causes
        if c.confusable_with
    ]


def next_run(experiment: Experiment) -> str:
    """Return the question that a run would decide, or why none is recommended, without a full stop."""
    rivals = f"{experiment.cause} and {list_names(experiment.rivals)}"
    alike = f"{rivals} do as well on these data"
    if experiment.reason == "other_amplitude":
        return f"{alike}; a run at another amplitude would show more"
    if experiment.reason == "separates":
        return f"{alike}; this run makes them differ by {experiment.separation:.1f} times the noise"
    if experiment.reason == "inseparable":
        return (
            f"{rivals} make the same motion under every excitation tried within the limits of rig and driver "
            f"(at most {experiment.separation:.2f} times the noise apart): only a separate measurement "
            "distinguishes them, such as the spring stiffness by a known weight"
        )
    multisine = " with an odd multisine, whose empty lines show distortion apart from noise"
    amplitude = {0.5: "half", 2.0: "twice"}[experiment.amplitude]
    return (
        f"nothing in the catalogue explains what is left: repeat at {amplitude} the "
        f"amplitude{multisine if experiment.excitation else ''}; what scales with the command is linear, "
        "what does not is friction-like"
    )


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
