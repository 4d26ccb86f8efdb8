"""The result of an identification in words, for the terminal, the page and identification.json."""

from __future__ import annotations

from rsea_ros.documents.wording import list_names
from rsea_ros.identification.identify import explained_by_lost_cycles
from rsea_ros.identification.result import Identification
from rsea_ros.report import words
from rsea_ros.report.remark_words import coloured_noise
from rsea_ros.report.rig.words import command, rig_in_brackets, values_off

_LOST = (
    "Behind the lost cycles the motor torque is further from its commands than elsewhere: the computer was "
    "too busy. Record again on an idle computer, or run the driver with realtime_priority (docs/hardware.md)."
)


def verdict_sentence(identification: Identification) -> str:
    """Return whether the model fits, by the worst channel's residual over its noise, and the rig by name."""
    parts = (_verdict(identification), values_off(identification.remarks), _bias_text(identification))
    return "; ".join(filter(None, parts))


def _bias_text(identification: Identification) -> str:
    """Return that the intervals do not hold where a channel was averaged: the values make up for it."""
    averaged = [words.channel(f.channel) for f in identification.faults if f.kind == "smoothing"]
    biased = "averaged before logging, which biases values beyond their intervals"
    return f"{list_names(averaged)} {biased}" if averaged else ""


def _verdict(identification: Identification) -> str:
    ratios = identification.times_noise
    rig = rig_in_brackets(identification.rig.name, identification.rig_choice)
    if not ratios:
        return f"No channel to test the model with ({rig})"
    worst = max(ratios, key=lambda n: ratios[n])
    size = f"{words.channel(worst)} {times(ratios[worst])} times the noise ({rig})"
    if lost := explained_by_lost_cycles(identification):
        return f"The model does not fit: {size}; {lost} lost cycles of the driver are the likely cause"
    if not identification.at_noise:
        return f"The model does not fit: {size}"
    if identification.silent:
        silent = words.sentence(list_names([words.channel(n) for n in identification.silent]))
        return f"{silent} measures nothing; the model fits the rest: {size}"
    if identification.verdict == "not_identifiable":
        return f"The model fits: {size}; but these data determine none of its values"
    return f"The model fits: {size}"


def times(ratio: float) -> str:
    """Return a ratio, rounded so that it stays on its side of the limit."""
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def next_command(identification: Identification) -> str:
    """Return the command that diagnoses a model that does not fit; empty if it fits, or the run was bad."""
    if identification.at_noise or explained_by_lost_cycles(identification):
        return ""
    i = identification
    return command("diagnose", i.sources, i.rig.name, i.rig_choice)


def doubt_sentences(identification: Identification) -> tuple[str, ...]:
    """Return the conditions of the intervals, if they cover more or less than noise."""
    sentences = []
    if identification.coloured:
        sentences.append(coloured_noise(identification.coloured))
    if explained_by_lost_cycles(identification):
        sentences.append(_LOST)
    elif not identification.at_noise:
        sentences.append(_misfit_sentence(identification))
    return tuple(sentences)


def _misfit_sentence(identification: Identification) -> str:
    if not identification.alternatives:
        return (
            "The intervals hold only if what the model lacks does not move its values: "
            "nothing simple that was tried explains the misfit."
        )
    names = " or ".join(words.effect(n) for n in identification.alternatives)
    return f"The intervals also span what {names} would make of the values: it explains a part of the misfit."
