"""An identification in words: sentences, the table of a terminal, identification.json."""

import math
from collections.abc import Mapping
from typing import Any

from rich.table import Table

from rsea_ros.documents.wording import list_names
from rsea_ros.identification.identify import explained_by_lost_cycles
from rsea_ros.identification.result import CLOCKS, Identification, ParameterEstimate, Statics
from rsea_ros.report import words
from rsea_ros.report.remark_words import coloured_noise, remark_sentences
from rsea_ros.report.result_files import fault_json, pick, strict
from rsea_ros.report.rig import command, rig_in_brackets, rig_json, values_off

SCHEMA = 1
_LOST = (
    "Behind the lost cycles the motor torque is further from its commands than elsewhere: the computer was "
    "too busy. Record again on an idle computer, or run the driver with realtime_priority (docs/hardware.md)."
)


def verdict_sentence(identification: Identification) -> str:
    """Return whether the model fits, by the worst channel's residual over its noise, and the rig by name.

    Where a channel was averaged, the intervals do not hold: the values make up for it.
    """
    averaged = [words.channel(f.channel) for f in identification.faults if f.kind == "smoothing"]
    biased = f"{list_names(averaged)} averaged before logging, which biases values beyond their intervals"
    parts = (_verdict(identification), values_off(identification.remarks), biased if averaged else "")
    return "; ".join(filter(None, parts))


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
    i = identification
    if i.at_noise or explained_by_lost_cycles(i):
        return ""
    return command("diagnose", i.sources, i.rig.name, i.rig_choice)


def doubt_sentences(identification: Identification) -> tuple[str, ...]:
    """Return the conditions of the intervals, if they cover more or less than noise."""
    sentences = [coloured_noise(identification.coloured)] if identification.coloured else []
    if explained_by_lost_cycles(identification):
        sentences.append(_LOST)
    elif not identification.at_noise and identification.alternatives:
        names = " or ".join(words.effect(n) for n in identification.alternatives)
        far = any(p.beside_misfit for p in identification.parameters)
        sentences.append(
            f"{words.sentence(names)} explains a part of the misfit, which is still far from the noise: the "
            "values hold only if what else is missing does not move them."
            if far
            else f"The intervals also span what {names} would make of the values: it explains a part of the "
            "misfit."
        )
    elif not identification.at_noise:
        sentences.append(
            "The values hold only if what the model lacks does not move them: nothing simple that was tried "
            "explains the misfit."
        )
    return tuple(sentences)


def statics_sentences(statics: Statics) -> tuple[str, ...]:
    """Return travel, stiffness and limit of slow ramps against a locked output, a sentence each."""
    end, lost = words.number(statics.torque, 3), math.degrees(statics.lost_motion)
    at_rest = f", {lost:.2f}° of it at no load" if math.isfinite(lost) else ""
    reached = None if statics.limit is None else words.number(statics.limit, 3)
    return (
        f"Between −{end} and +{end} N·m of command the output angle travels "
        f"{math.degrees(statics.travel):.2f}°{at_rest}.",
        f"Static stiffness while the load grows: {words.quantity(statics.stiffness, 'N m/rad')}.",
        "The motor torque follows the command to its ends: no saturation."
        if reached is None
        else f"Saturation: the motor torque stops at {reached} N·m where {end} N·m are commanded.",
    )


def value_text(p: ParameterEstimate) -> tuple[str, str]:
    """Return a value and its 95 % interval: ("1530.5", " ± 0.1"), or lopsided ("1391", " (1391 … 1531)").

    Far from the noise there is no interval: it would hold the noise alone, not the law that is missing.
    """
    value, half = words.with_interval(p.value, *p.ci95)
    if p.beside_misfit:
        return value, " (no interval)"
    low, high = p.ci95
    sides = sorted((p.value - low, high - p.value))
    if not half or sides[1] <= words.LOPSIDED * sides[0]:
        return value, f" ± {half}" if half else ""
    decimals = 2 - math.floor(math.log10(sides[1]))
    step = 10.0**-decimals
    ends = (p.value, step * math.floor(low / step), step * math.ceil(high / step))
    shown = [words.minus(f"{v:.{max(0, decimals)}f}" if decimals < 9 else f"{v:.2e}") for v in ends]
    return shown[0], f" ({shown[1]} … {shown[2]})"


def terminal_table(identification: Identification, truth: Mapping[str, float] | None = None) -> Table:
    """Return the parameters with their 95 % intervals. truth: true values by name, where they are known."""
    known = truth or {}

    def inside(p: ParameterEstimate) -> str:
        return "[green]yes[/]" if p.ci95[0] <= known[p.name] <= p.ci95[1] else "[red]no[/]"

    table = Table(box=None, pad_edge=False, title_justify="left", header_style="dim")
    for title, justify in (
        ("parameter", "left"), ("value ± 95 %", "right"), ("unit", "left"), ("rig", "right"),
    ):  # fmt: skip
        table.add_column(title, justify=justify, style="dim" if title == "unit" else None)  # type: ignore[arg-type]
    if truth is not None:
        table.add_column("true", justify="right")
        table.add_column("in interval")
    table.add_column("determined by data")
    for p in identification.parameters:
        if not p.name.startswith(CLOCKS):
            cells = [p.name, "".join(value_text(p)), words.unit(p.unit), words.number(p.start, 4)]
            if truth is not None:
                cells += [words.number(known[p.name], 5), inside(p)] if p.name in known else ["", ""]
            table.add_row(*cells, p.determined)
    return table


def identification_json(identification: Identification) -> dict[str, Any]:
    """Return the contents of identification.json; infinite numbers and NaN are null."""
    i = identification
    return {
        "schema": SCHEMA,
        "rig": i.rig.name,
        **rig_json(i.rig_choice, i.remarks),
        "verdict": i.verdict,
        "sentence": verdict_sentence(i),
        "next": next_command(i) or None,
        "data": {**pick(i, "bags=sources duration_s=duration rate_hz=rate"),
                 "faults": [fault_json(f) for f in i.faults]},
        "parameters": parameters_json(i.parameters),
        "correlation": {"names": [p.name for p in i.parameters], "matrix": strict(i.correlation)},
        **pick(i, "residual_rms noise_rms times_noise fit_percent"),
        "responses": [
            {**pick(r, "input output method"), "lines": len(r.frequency),
             "from_hz": strict(r.frequency[0]), "to_hz": strict(r.frequency[-1])}
            for r in i.responses if len(r.frequency)
        ],
        **(pick(i, "statics") if i.statics else {}),
        "alternatives": list(i.alternatives),
        "statements": [*doubt_sentences(i), *remark_sentences(i.remarks)],
        "notes": [*i.notes, *remark_sentences(i.clocks)],
    }  # fmt: skip


def parameters_json(parameters: tuple[ParameterEstimate, ...]) -> dict[str, Any]:
    """Return parameters by name for the result files."""
    return {p.name: pick(p, "value unit ci95 start told_by_data") for p in parameters}
