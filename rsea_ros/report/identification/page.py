"""The report of an identification, as one HTML file beside identification.json and model.yaml."""

import math
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

import numpy as np

from rsea_ros.identification.result import CLOCKS, Identification, Overlay, ParameterEstimate
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.records.record import SENSED, UNITS, FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import page as html, words
from rsea_ros.report.figures.bode import bode_figure
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, MEASURED, QUIET, Figure, faint
from rsea_ros.report.figures.overlay import Simulated, overlay_figure
from rsea_ros.report.figures.spectrum import SpectrumLine, density, finding, residual_figure
from rsea_ros.report.identification import words as say
from rsea_ros.report.remark_words import fault_lines, remark_sentences
from rsea_ros.report.result_files import IDENTIFICATION_JSON, MODEL, REPORT, Provenance, json_text
from rsea_ros.report.rig import rig_named, right_rig_block, split_off_rig

STRONG = 0.9
"""Correlation from which two values are hardly distinguishable."""
_WIDTH, _HEIGHT = 190.0, 26.0


def write_results(
    identification: Identification, out: Destination | str | Path, provenance: Provenance | None = None
) -> Path:
    """Write identification.json, model.yaml and report.html, and return the report's path: all or none.

    Raises OutputError for a name that is taken, OSError where something cannot be written.
    """
    with NewFiles(out) as new:
        new.write(IDENTIFICATION_JSON, json_text(say.identification_json(identification), provenance))
        new.write(MODEL, rig_text(identification.rig))
        return new.write(REPORT, identification_report(identification, provenance))


def identification_report(identification: Identification, provenance: Provenance | None = None) -> str:
    """Return the report as HTML that opens offline."""
    i = identification
    kicker = f"Identification of {rig_named(i.rig.name, i.rig_choice)} · "
    damage = [words.sentence(f"{line}.") for line in fault_lines(i.faults)]
    notes = [*i.notes, *remark_sentences(i.clocks), "rsea identify. All values in SI."]
    footer = [f"Data: {', '.join(i.sources)}", *damage, *notes]
    about = i.rig.about or i.rig.name.replace("_", " ")
    return html.page(say.verdict_sentence(i), kicker + about, _blocks(i), footer, provenance)


def _blocks(i: Identification) -> Iterator[html.Block]:
    if i.residual_rms:
        n = next((n for n in SENSED if n in i.residual_rms), next(iter(i.residual_rms)))
        yield html.key_numbers([
            (f"{i.fit_percent[n]:.2f} %", f"of the {words.channel(n)} explained"),
            (words.quantity(i.residual_rms[n], UNITS[n], 3), "residual, RMS"),
            (words.quantity(i.noise_rms[n], UNITS[n], 3), "sensor noise, RMS"),
            (f"{i.duration:.0f} s", f"of data at {i.rate:.0f} Hz"),
        ])  # fmt: skip
    if following := say.next_command(i):
        yield html.paragraph(
            html.Html(f'<p class="next">To find the cause and its gain: {html.code(following)}</p>')
        )
    yield right_rig_block(i.remarks)
    yield _parameters(i.parameters)
    if i.statics is not None:
        yield html.section(
            "Slow ramps against the locked output", html.bullets(say.statics_sentences(i.statics))
        )
    models = i.models or (None,) * len(i.responses)
    yield from map(bode_figure, i.responses, models)
    by_name = {o.channel: o for o in i.overlays}  # the motor torque only repeats the command
    for overlay in [by_name[n] for n in SENSED if n in by_name] or i.overlays:
        yield _over_time(i, overlay)
        yield _over_frequency(i, overlay)
    unclear = (*say.doubt_sentences(i), *remark_sentences(split_off_rig(i.remarks)[1]))
    yield undetermined_section(unclear)
    physical = [k for k, p in enumerate(i.parameters) if not p.name.startswith("clock.")]
    names = [i.parameters[k].name for k in physical]
    yield correlation_section(names, i.correlation[np.ix_(physical, physical)])


def undetermined_section(sentences: Sequence[str]) -> html.Html:
    """Return what data cannot determine, a sentence each."""
    body = html.bullets(sentences) if sentences else "The data determine every free value."
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
        f"{words.channel(p.name.split('.')[1])} {words.quantity(p.value, p.unit, 2)} (95 %: "
        f"{words.quantity(p.ci95[0], p.unit, 2)} to "
        f"{words.quantity(p.ci95[1], p.unit, 2)}){' of the time passed' if p.unit == 'ppm' else ''}"
        for p in parameters
        if p.name.startswith(CLOCKS) and not p.ci95[0] <= 0.0 <= p.ci95[1]
    ]
    return f"Sensors read later than their stamps by: {'; '.join(parts)}." if parts else ""


def parameter_table(parameters: Sequence[ParameterEstimate]) -> html.Html:
    """Return the physical parameters, sensor clocks left out: value, interval, the rig's, how sure."""
    return html.listed(
        [p for p in parameters if not p.name.startswith(CLOCKS)],
        ("Parameter", _named),
        ("#Value ± 95 %", lambda p: html.Html("<b>{}</b>{}".format(*say.value_text(p)))),
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


def _over_time(i: Identification, overlay: Overlay) -> Figure:
    n = overlay.channel
    left = f"{i.fit_percent[n]:.2f} % explained, {words.quantity(i.residual_rms[n], UNITS[n])} RMS left"
    title = words.sentence(f"{words.channel(n)} over time: {left}")
    simulated = Simulated("simulated", AFTER, overlay.simulated)
    return overlay_figure(title, n, overlay.t, overlay.measured, [simulated])


def _over_frequency(i: Identification, overlay: Overlay) -> Figure:
    n = overlay.channel
    rate = float((len(overlay.t) - 1) / (overlay.t[-1] - overlay.t[0]))
    frequency, values = density(overlay.measured - overlay.simulated, rate)
    noise = i.noise_rms[n] / float(np.sqrt(rate / 2.0))
    measured = SpectrumLine("measured", MEASURED, density(overlay.measured, rate)[1])
    title = finding(frequency, values, noise, words.channel(n))
    return residual_figure(title, n, frequency, [measured, SpectrumLine("residual", AFTER, values)], noise)


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
