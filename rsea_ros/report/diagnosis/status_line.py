"""The certainty of each cause in sentences: status, size, interval, probability, rivals."""

from __future__ import annotations

from collections.abc import Sequence

from rsea_ros.diagnosis.result import Alternative, Cause
from rsea_ros.documents.wording import list_names
from rsea_ros.report import words

STATUS = {"confirmed": "confirmed", "leading": "leading", "one_of": "one of"}
_REASON = {
    "confirmed": "the simulation certainly lacks it",
    "leading": "it certainly helps on held-out data, but part of the misfit remains",
    "one_of": "these data do not distinguish them",
}


def status_line(cause: Cause, alternatives: Sequence[Alternative] = (), at_floor: bool = False) -> str:
    """Return `leading: command_delay 9.10 ms [8.40, 9.80], probability 0.87; …` of a cause.

    alternatives: of the whole diagnosis. at_floor: the residual with all causes is noise.
    """
    rivals = against(cause, alternatives)
    items: list[Cause | Alternative] = [cause, *rivals]
    listed_items = [f"{size_text(item)}, probability {item.probability:.2f}" for item in items]
    reason = _REASON[cause.status]
    if at_floor and cause.status == "leading":
        reason = "it reduces the residual to the noise, but another law may do the same"
    if cause.status == "one_of" and rivals:
        return f"one of: {list_names(listed_items, 'or')}; {reason}"
    text = f"{STATUS[cause.status]}: {listed_items[0]}; {reason}"
    return f"{text}; less likely instead: {list_names(listed_items[1:], 'or')}" if rivals else text


def against(cause: Cause, alternatives: Sequence[Alternative]) -> list[Alternative]:
    """Return the rivals of a cause, the likeliest first."""
    return sorted((a for a in alternatives if a.instead_of == cause.name), key=lambda a: -a.probability)


def size_text(item: Cause | Alternative) -> str:
    """Return name and main parameter with its 95 % interval: `command_delay 9.10 ms [8.40, 9.80]`."""
    if not item.parameters:
        return item.name
    parameter = next(iter(item.parameters.values()))
    factor, unit = words.unit_factor(parameter.value, parameter.unit)
    value, low, high = (words.number(v * factor) for v in (parameter.value, *parameter.ci95))
    return f"{item.name} {value}{f' {unit}' if unit else ''} [{low}, {high}]"
