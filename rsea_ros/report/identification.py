"""An identification as page, sentences, table of a terminal and identification.json."""

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Column, Table

from rsea_ros.documents.wording import list_names
from rsea_ros.identification.identify import explained_by_lost_cycles
from rsea_ros.identification.result import CLOCKS, Identification, Overlay, ParameterEstimate, Remark, Statics
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.files import Destination, NewFiles
from rsea_ros.records.record import SENSED, UNITS, FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import page as html, remark_words as remarks, result_files as outputs, words
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, MEASURED, QUIET, Curve, Figure, faint
from rsea_ros.report.figures.overlay import overlay_figure
from rsea_ros.report.figures.response import bode_figure
from rsea_ros.report.figures.spectrum import density, finding, residual_figure

STRONG = 0.9
"""Correlation from which two values are hardly distinguishable."""
_WIDTH, _HEIGHT = 190.0, 26.0


def write_results(
    identification: Identification,
    out: Destination | str | Path,
    provenance: outputs.Provenance | None = None,
) -> Path:
    """Write identification.json, model.yaml and report.html, and return the report's path: all or none.

    Raises OutputError for a name that is taken, OSError where something cannot be written.
    """
    with NewFiles(out) as new:
        content = outputs.json_text(identification_json(identification), provenance)
        new.write(outputs.IDENTIFICATION_JSON, content)
        new.write(outputs.MODEL, rig_text(identification.rig))
        return new.write(outputs.REPORT, identification_report(identification, provenance))


def identification_report(
    identification: Identification, provenance: outputs.Provenance | None = None
) -> str:
    """Return the report as HTML that opens offline."""
    i = identification
    kicker = f"Identification of {remarks.rig_named(i.rig.name, i.rig_choice)} · "
    damage = [words.sentence(f"{line}.") for line in remarks.fault_lines(i.faults)]
    notes = [*i.notes, *remarks.remark_sentences(i.clocks), "rsea identify. All values in SI."]
    footer = [f"Data: {', '.join(i.sources)}", *damage, *notes]
    about = i.rig.about or i.rig.name.replace("_", " ")
    return html.page(verdict_sentence(i), kicker + about, _blocks(i), footer, provenance)


def _blocks(i: Identification) -> Iterator[html.Block]:
    if i.residual_rms:
        n = next((n for n in SENSED if n in i.residual_rms), next(iter(i.residual_rms)))
        yield html.key_numbers([
            (f"{i.fit_percent[n]:.2f} %", f"of the {words.channel(n)} explained"),
            (words.quantity(i.residual_rms[n], UNITS[n], 3), "residual, RMS"),
            (words.quantity(i.noise_rms[n], UNITS[n], 3), "sensor noise, RMS"),
            (f"{i.duration:.0f} s", f"of data at {i.rate:.0f} Hz"),
        ])  # fmt: skip
    if following := next_command(i):
        yield html.Html(f'<p class="next">To find the cause and its gain: {html.code(following)}</p>')
    yield remarks.right_rig_block(i.remarks)
    yield _parameters(i.parameters)
    if i.statics is not None:
        yield html.section("Slow ramps against the locked output", html.bullets(statics_sentences(i.statics)))
    models = i.models or (None,) * len(i.responses)
    yield from map(bode_figure, i.responses, models)
    by_name = {o.channel: o for o in i.overlays}  # the motor torque only repeats the command
    for o in [by_name[n] for n in SENSED if n in by_name] or i.overlays:
        n, named = o.channel, (words.channel(o.channel), words.unit(UNITS[o.channel]))
        left = f"{i.fit_percent[n]:.2f} % explained, {words.quantity(i.residual_rms[n], UNITS[n])} RMS left"
        title = words.sentence(f"{named[0]} over time: {left}")
        yield overlay_figure(title, *named, o.t, o.measured, [Curve("simulated", AFTER, o.simulated)])
        yield _over_frequency(i, o)
    yield undetermined_section(doubt_sentences(i), i.remarks)
    physical = [k for k, p in enumerate(i.parameters) if not p.name.startswith("clock.")]
    names = [i.parameters[k].name for k in physical]
    yield correlation_section(names, i.correlation[np.ix_(physical, physical)])


def undetermined_section(sentences: Sequence[str], said: Sequence[Remark]) -> html.Html:
    """Return what data cannot determine: sentences, and remarks that are not about the rig."""
    every = [*sentences, *remarks.remark_sentences(remarks.split_off_rig(said)[1])]
    body = html.bullets(every) if every else "The data determine every free value."
    return html.section("What these data cannot determine", body)


def _parameters(parameters: Sequence[ParameterEstimate]) -> html.Html:
    physical = [p for p in parameters if not p.name.startswith(CLOCKS)]
    settled = sum(p.determined == "yes" for p in physical)
    share = f"all {settled}" if settled == len(physical) else f"{settled} of {len(physical)}"
    return html.section(
        f"The data determine {share} parameters",
        parameter_table(parameters),
        html.paragraph(_clock_sentence(parameters), "caption under"),
        caption="Grey: value of the rig with its 95 % range. Blue: result with its 95 % interval.",
    )


def _clock_sentence(parameters: Sequence[ParameterEstimate]) -> str:
    """Return the time offsets of the sensors; empty if all stamps may be correct."""
    parts = [
        f"{words.channel(p.name.split('.')[1])} {words.measured_text(p.value, *p.ci95, p.unit)}"
        f"{' of the time passed' if p.unit == 'ppm' else ''}"
        for p in parameters
        if p.name.startswith(CLOCKS) and not p.ci95[0] <= 0.0 <= p.ci95[1]
    ]
    return f"Sensors read later than their stamps by (95 %): {'; '.join(parts)}." if parts else ""


def parameter_table(parameters: Sequence[ParameterEstimate]) -> html.Html:
    """Return the physical parameters, sensor clocks left out: value, interval, the rig's, how sure."""
    return html.listed(
        [p for p in parameters if not p.name.startswith(CLOCKS)],
        ("Parameter", _named),
        ("#Value ± 95 %", lambda p: html.Html("<b>{}</b>{}".format(*value_text(p)))),
        ("Unit", lambda p: html.Html(f"<span class='unit'>{escape(words.unit(p.unit))}</span>")),
        ("Compared with the rig", _interval),
        ("#Rig", lambda p: words.number(p.start, 4)),
        (
            "#Change",
            lambda p: words.signed_text(100.0 * (p.value / p.start - 1.0), 1) + " %" if p.start else "–",
        ),
        ("Determined by data", lambda p: p.determined),
    )


def _named(p: ParameterEstimate) -> html.Html:
    letter, _, index = words.SYMBOLS.get(p.name, "").partition("_")
    symbol = f"<i>{letter}</i><sub>{index}</sub>" if letter else ""
    return html.named(html.Html(f"{escape(words.parameter(p.name))} {symbol}"), p.name)


def _interval(p: ParameterEstimate) -> html.Html:
    """Return a small drawing: prior as a grey bar (95 %), its middle, and the result with its interval."""
    side = Z95 * p.spread * abs(p.start)
    if not (math.isfinite(side) and side > 0.0):
        side = max(abs(p.value - p.start), p.ci95[1] - p.ci95[0]) or 1.0
    reach = 1.15 * max(side, abs(p.value - p.start), *(abs(v - p.start) for v in p.ci95 if math.isfinite(v)))

    def at(value: float) -> str:
        return f"{_WIDTH / 2.0 * (1.0 + max(-1.0, min(1.0, (value - p.start) / reach))):.1f}"

    def stroke(low: float, high: float, colour: str, width: float) -> str:
        return (f'<line x1="{at(low)}" x2="{at(high)}" y1="{middle:g}" y2="{middle:g}" '
                f'stroke="{colour}" stroke-width="{width:g}" stroke-linecap="round"/>')  # fmt: skip

    middle = _HEIGHT / 2.0
    rig = f"rig {p.start - side:.4g} to {p.start + side:.4g}"
    spoken = escape(f"{rig}, result {p.value:.4g} {words.unit(p.unit)}".rstrip())
    return html.Html(
        f'<svg class="interval" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" role="img" aria-label="{spoken}">'
        f"<title>{spoken}</title>{stroke(p.start - side, p.start + side, GRID, 8)}"
        f'<line x1="{at(p.start)}" x2="{at(p.start)}" y1="{middle - 7:g}" y2="{middle + 7:g}" '
        f'stroke="{QUIET}"/>{stroke(*p.ci95, faint(AFTER, 0.55), 6)}'
        f'<circle cx="{at(p.value)}" cy="{middle:g}" r="4" fill="{AFTER}"/></svg>'
    )


def _over_frequency(i: Identification, overlay: Overlay) -> Figure:
    n = overlay.channel
    rate, frequency, values = density(overlay.t, overlay.measured - overlay.simulated)
    noise = i.noise_rms[n] / float(np.sqrt(rate / 2.0))
    measured = Curve("measured", MEASURED, density(overlay.t, overlay.measured)[2])
    title = finding(frequency, values, noise, words.channel(n))
    return residual_figure(title, n, frequency, [measured, Curve("residual", AFTER, values)], noise)


def correlation_section(names: Sequence[str], matrix: FloatArray) -> html.Html:
    """Return which parameters move together, as shaded cells; empty for fewer than two parameters.

    matrix: (n, n), nan where not defined.
    """
    if len(names) < 2:
        return html.Html()
    rows = [[f"{i + 1} {words.parameter(name)}", *map(_cell, matrix[i])] for i, name in enumerate(names)]
    shown = html.table(["", *(f"#{i}" for i in range(1, len(names) + 1))], rows, "matrix")
    return html.fold("Correlation of the parameters", correlation_finding(names, matrix), shown)


def correlation_finding(names: Sequence[str], matrix: FloatArray) -> str:
    """Return a sentence on the pair that is least distinguishable."""
    apart = np.abs(np.where(np.eye(len(names), dtype=bool), 0.0, np.nan_to_num(matrix)))
    i, k = (int(v) for v in np.unravel_index(int(np.argmax(apart)), apart.shape))
    pair = (
        f"{words.parameter(names[i])} and {words.parameter(names[k])} ({words.minus(f'{matrix[i, k]:.2f}')})"
    )
    if apart[i, k] < STRONG:
        return f"No two are strongly correlated; the strongest pair is {pair}."
    return f"Strongly correlated: {pair}. An error in one is compensated by the other."


def _cell(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    shade = faint(AFTER if value >= 0.0 else BEFORE, 0.6 * min(1.0, abs(float(value))))
    return html.Html(f"<span style='background:{shade}'>{words.minus(f'{value:.2f}')}</span>")


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
    parts = (_verdict(identification), remarks.values_off(identification.remarks), biased if averaged else "")
    return "; ".join(filter(None, parts))


def _verdict(identification: Identification) -> str:
    ratios = identification.times_noise
    rig = remarks.rig_in_brackets(identification.rig.name, identification.rig_choice)
    if not ratios:
        return f"No channel to test the model with ({rig})"
    worst = max(ratios, key=lambda n: ratios[n])
    size = f"{words.channel(worst)} {words.times(ratios[worst])} times the noise ({rig})"
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


def next_command(identification: Identification) -> str:
    """Return the command that diagnoses a model that does not fit; empty if it fits, or the run was bad."""
    i = identification
    if i.at_noise or explained_by_lost_cycles(i):
        return ""
    return remarks.command("diagnose", i.sources, i.rig.name, i.rig_choice)


def doubt_sentences(identification: Identification) -> tuple[str, ...]:
    """Return the conditions of the intervals, if they cover more or less than noise."""
    sentences = [remarks.coloured_noise(identification.coloured)] if identification.coloured else []
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
    """Return a value and its 95 % interval: ("1530", " ± 30"), or lopsided ("1391.345", " −0.060/+139").

    Far from the noise there is no interval: it would hold the noise alone, not the law that is missing.
    """
    if p.beside_misfit:
        return words.with_interval(p.value, *p.ci95)[0], " (no interval)"
    return words.with_doubt(p.value, *p.ci95)


def terminal_table(identification: Identification, truth: Mapping[str, float] | None = None) -> Table:
    """Return the parameters with their 95 % intervals. truth: true values by name, where they are known."""
    known = truth or {}

    def inside(p: ParameterEstimate) -> str:
        return "[green]yes[/]" if p.ci95[0] <= known[p.name] <= p.ci95[1] else "[red]no[/]"

    known_too: list[Column | str] = [] if truth is None else [Column("true", justify="right"), "in interval"]
    table = Table(
        "parameter", Column("value ± 95 %", justify="right"), Column("unit", style="dim"),
        Column("rig", justify="right"), *known_too, "determined by data",
        box=None, pad_edge=False, title_justify="left", header_style="dim",
    )  # fmt: skip
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
        "schema": 1,
        "rig": i.rig.name,
        **remarks.rig_json(i.rig_choice, i.remarks),
        "verdict": i.verdict,
        "sentence": verdict_sentence(i),
        "next": next_command(i) or None,
        "data": {**outputs.pick(i, "bags=sources duration_s=duration rate_hz=rate"),
                 "faults": [outputs.fault_json(f) for f in i.faults]},
        "parameters": parameters_json(i.parameters),
        "correlation": {"names": [p.name for p in i.parameters], "matrix": outputs.strict(i.correlation)},
        **outputs.pick(i, "residual_rms noise_rms times_noise fit_percent"),
        "responses": [
            {**outputs.pick(r, "input output method"), "lines": len(r.frequency),
             "from_hz": outputs.strict(r.frequency[0]), "to_hz": outputs.strict(r.frequency[-1])}
            for r in i.responses if len(r.frequency)
        ],
        **(outputs.pick(i, "statics") if i.statics else {}),
        "alternatives": list(i.alternatives),
        "statements": [*doubt_sentences(i), *remarks.remark_sentences(i.remarks)],
        "notes": [*i.notes, *remarks.remark_sentences(i.clocks)],
    }  # fmt: skip


def parameters_json(parameters: tuple[ParameterEstimate, ...]) -> dict[str, Any]:
    """Return parameters by name for the result files."""
    return {p.name: outputs.pick(p, "value unit ci95 start told_by_data") for p in parameters}
