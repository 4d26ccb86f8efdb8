"""The verdict, the evidence and the next run of a diagnosis, a sentence each."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.diagnosis.result import Cause, Diagnosis, Experiment, Verdict
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.result import is_unexcited, silent_channels
from rsea_ros.records.record import MASKED, Fault
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.rig.words import values_off

_AMPLITUDES = {0.5: "half", 2.0: "twice"}


def verdict_sentence(
    verdict: Verdict,
    causes: Sequence[Cause],
    channel: str,
    before: float,
    after: float,
    faults: Sequence[Fault],
    at_floor: bool = False,
    off: str = "",
    rest: str = "the rest stays unexplained",
) -> str:
    """Return the verdict as one sentence.

    before, after: held-out residual of the channel over its noise. at_floor: of all channels with all causes.
    off: how many values are not the rig's, empty for none. rest: of the misfit, where a part is explained.
    """
    name, data = words.channel(channel), (f" {off}." if off else "") + _data(faults)
    named = words.sentence(list_names([words.effect(c.name) for c in causes]))
    pronoun, explains = ("them", "explain") if len(causes) > 1 else ("it", "explains")
    fall = f"with {pronoun} the {name} residual falls from {before:.1f} to"
    silent = [words.channel(n) for n in silent_channels(faults)]
    if verdict == "unexplained" and silent and at_floor:
        return (
            f"The {list_names(silent)} measures nothing and is left out; with the model's values re-fitted "
            f"the {name} residual is at the noise floor ({after:.2f} times the noise).{data}"
        )
    if verdict == "nothing_wrong" and is_unexcited(faults):
        return f"These data show nothing: the command never changes, so no cause could be seen.{data}"
    if verdict == "nothing_wrong":
        fine = "The structure of the model fits" if off else "Nothing is wrong with the model"
        return (
            f"{fine}: with its values re-fitted the {name} residual "
            f"is at the noise floor ({after:.2f} times the noise).{data}"
        )
    if verdict == "unexplained":
        size = f"{math.ceil(100.0 * before) / 100.0:.2f}" if before < 2.0 else f"{before:.1f}"
        return f"The {name} residual is {size} times the noise; no known effect explains it.{data}"
    if verdict == "partly_explained" and at_floor:
        doubt = "but another law may do the same"
        return f"{named} probably {explains} the misfit: {fall} {after:.2f} times the noise, {doubt}.{data}"
    if verdict == "explained":
        return f"{named} {explains} the misfit: {fall} {after:.2f} times the noise, which is the floor.{data}"
    return f"{named} {explains} part of the misfit: {fall} {_times(after)} times the noise; {rest}.{data}"


def _times(ratio: float) -> str:
    """Return a ratio near the floor with two digits behind the point."""
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.1f}"


def diagnosis_sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict of a diagnosis as one sentence."""
    d, (before, after) = diagnosis, num.times_noise(diagnosis, diagnosis.channel)
    off = words.sentence(values_off(d.remarks))
    rest = "the rest stays unexplained"
    if left := num.left_channel(d):
        size = _times(num.times_noise(d, left)[1])
        rest = f"the {words.channel(left)} residual stays at {size} times the noise"
    return verdict_sentence(
        d.verdict, d.causes, d.channel, before, after, d.faults, d.at_noise_floor, off, rest
    )


def evidence(cause: Cause) -> str:
    """Return the evidence for a cause as one sentence."""
    before, after = cause.times_noise
    return (
        f"With {effect_named(cause.name).about}, the {words.channel(cause.channel)} residual of data "
        f"that took no part falls from {before:.2f} to {after:.2f} times the noise "
        f"(gain {words.minus(f'{100.0 * cause.gain_holdout:.1f}')} %)."
    )


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
            f"{rivals} make the same motion under every excitation tried within the limits of rig and "
            f"driver (at most {experiment.separation:.2f} times the noise apart): "
            "only a separate measurement distinguishes them, such as the spring stiffness by a known weight"
        )
    multisine = " with an odd multisine, whose empty lines show distortion apart from noise"
    return (
        f"nothing in the catalogue explains what is left: repeat at {_AMPLITUDES[experiment.amplitude]} the "
        f"amplitude{multisine if experiment.excitation else ''}; "
        "what scales with the command is linear, what does not is friction-like"
    )


def _data(faults: Sequence[Fault]) -> str:
    """Return which faults the data have, each kind once, and which samples of them are masked."""
    channels: dict[str, list[str]] = {}
    for f in faults:
        channels.setdefault(f.kind, []).append(f.channel)
    texts = {kind: _fault(kind, list(dict.fromkeys(names))) for kind, names in channels.items()}
    left = "; ".join(text for kind, text in texts.items() if kind not in MASKED)
    masked = "; ".join(text for kind, text in texts.items() if kind in MASKED)
    return (f" The data have faults: {left}." if left else "") + (
        f" Samples were masked: {masked}." if masked else ""
    )


def _fault(kind: str, channels: Sequence[str]) -> str:
    """Return `frozen samples in ft`, or `velocity missing`."""
    names = list_names(channels)
    return f"{names} missing" if kind == "missing_topic" else f"{kind.replace('_', ' ')} in {names}"
