"""What an identification comes to, in words: for the terminal, the page and identification.json alike."""

from __future__ import annotations

import shlex

from rsea_ros.identification.result import Identification
from rsea_ros.report import words
from rsea_ros.wording import listed


def verdict_sentence(identification: Identification) -> str:
    """Return whether the model fits, by the worst channel's residual over its noise, and the rig by name."""
    ratios, rig = identification.times_noise, f"rig {identification.rig.name}"
    if not ratios:
        return f"No channel to judge the model by ({rig})"
    worst = max(ratios, key=lambda n: ratios[n])
    size = f"{words.channel(worst)} {times(ratios[worst])} times the noise ({rig})"
    if not identification.at_noise:
        return f"The model does not fit: {size}"
    if identification.silent:
        silent = words.sentence(listed([words.channel(n) for n in identification.silent]))
        return f"{silent} measures nothing; the model fits the rest: {size}"
    if identification.verdict == "not_identifiable":
        return f"The model fits: {size}; but these data determine none of its values"
    return f"The model fits: {size}"


def times(ratio: float) -> str:
    """Return a ratio so that it never reads as one on the other side of a limit."""
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.2g}" if ratio < 100.0 else f"{ratio:.0f}"


def next_command(identification: Identification) -> str:
    """Return the command that says what is missing in a model that does not fit; empty for one that does."""
    if identification.at_noise:
        return ""
    rig = identification.rig_option or identification.rig.name
    bags = " ".join(shlex.quote(s) for s in identification.sources)
    return f"rsea diagnose {bags} --rig {shlex.quote(rig)}"


def doubt_sentences(identification: Identification) -> tuple[str, ...]:
    """Return what the intervals hold for, where that is more or less than noise."""
    said = []
    if identification.coloured:
        channels = listed([words.channel(n) for n in identification.coloured])
        said.append(
            f"The noise of the {channels} is coloured: its level was taken from the residual, which is "
            "steady, falls with frequency, and agrees with neither command nor motion nor another sensor."
        )
    if not identification.at_noise:
        said.append(_misfit_sentence(identification))
    return tuple(said)


def _misfit_sentence(identification: Identification) -> str:
    if not identification.alternatives:
        return (
            "The intervals hold only if what the model lacks does not move its values: "
            "nothing simple that was tried explains the misfit."
        )
    names = " or ".join(n.replace("_", " ") for n in identification.alternatives)
    return f"The intervals also span what {names} would make of the values: it explains a part of the misfit."
