"""The report of an identification, as one HTML file."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.result import CLOCKS, Identification, Overlay
from rsea_ros.records.record import SENSED, UNITS
from rsea_ros.report import words
from rsea_ros.report.fault_words import fault_lines
from rsea_ros.report.figures.bode import bode_figure
from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.figures.overlay import Simulated, overlay_figure
from rsea_ros.report.figures.palette import AFTER, MEASURED
from rsea_ros.report.figures.spectrum import SpectrumLine, density, finding, residual_figure
from rsea_ros.report.identification.correlation import correlation_section
from rsea_ros.report.identification.parameters import clock_sentence, parameter_table
from rsea_ros.report.identification.statics_sentences import statics_sentences
from rsea_ros.report.identification.words import doubt_sentences, next_command, verdict_sentence
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, code, key_numbers, paragraph, section
from rsea_ros.report.provenance import Provenance
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.rig.page import right_rig_block
from rsea_ros.report.rig.words import rig_named, split_off_rig


def identification_report(identification: Identification, provenance: Provenance | None = None) -> str:
    """Return the report as HTML that opens offline."""
    blocks: list[Block] = [
        key_numbers(_keys(identification)),
        _next(identification),
        right_rig_block(identification.remarks),
        _parameters(identification),
        _statics(identification),
    ]
    responses = identification.responses
    models = identification.models or (None,) * len(responses)
    blocks += [bode_figure(r, m) for r, m in zip(responses, models, strict=True)]
    for overlay in _shown_overlays(identification):
        blocks += [_over_time(identification, overlay), _over_frequency(identification, overlay)]
    blocks += [_undetermined_values(identification), _correlation(identification)]
    footer = [*_footer(identification), *(provenance.lines if provenance else ())]
    return page(verdict_sentence(identification), _kicker(identification), blocks, footer)


def main_channel(identification: Identification) -> str:
    """Return the most important channel."""
    present = [n for n in SENSED if n in identification.residual_rms]
    return present[0] if present else next(iter(identification.residual_rms), "")


def _next(identification: Identification) -> str:
    """Return the next step for a residual above the noise."""
    command = next_command(identification)
    if not command:
        return ""
    return f'<p class="next">To find the cause and its gain: {code(command)}</p>'


def _keys(identification: Identification) -> list[tuple[str, str]]:
    n = main_channel(identification)
    if not n:
        return []
    unit, name = UNITS[n], words.channel(n)
    return [
        (f"{identification.fit_percent[n]:.2f} %", f"of the {name} explained"),
        (words.quantity(identification.residual_rms[n], unit, 3), "residual, RMS"),
        (words.quantity(identification.noise_rms[n], unit, 3), "sensor noise, RMS"),
        (f"{identification.duration:.0f} s", f"of data at {identification.rate:.0f} Hz"),
    ]


def _kicker(identification: Identification) -> str:
    about = identification.rig.about or identification.rig.name.replace("_", " ")
    rig = rig_named(identification.rig.name, identification.rig_choice)
    return f"Identification of {rig} · {about}"


def _parameters(identification: Identification) -> str:
    clock = clock_sentence(identification.parameters)
    return section(
        _parameter_finding(identification),
        parameter_table(identification.parameters),
        f'<p class="caption under">{clock}</p>' if clock else "",
        caption="Grey: value of the rig with its 95 % range. Blue: result with its 95 % interval.",
    )


def _statics(identification: Identification) -> str:
    if identification.statics is None:
        return ""
    sentences = statics_sentences(identification.statics)
    return section("Slow ramps against the locked output", bullets(sentences))


def _parameter_finding(identification: Identification) -> str:
    physical = [p for p in identification.parameters if not p.name.startswith(CLOCKS)]
    settled = [p for p in physical if p.determined == "yes"]
    if len(settled) == len(physical):
        return f"The data determine all {len(physical)} parameters"
    return f"The data determine {len(settled)} of {len(physical)} parameters"


def _shown_overlays(identification: Identification) -> list[Overlay]:
    """Return the overlays that get a figure; the motor torque is left out, it only repeats the command."""
    by_name = {o.channel: o for o in identification.overlays}
    return [by_name[n] for n in SENSED if n in by_name] or list(identification.overlays)


def _over_time(identification: Identification, overlay: Overlay) -> Figure:
    unit, n = UNITS[overlay.channel], overlay.channel
    title = (
        f"{words.channel(n)} over time: {identification.fit_percent[n]:.2f} % explained, "
        f"{words.quantity(identification.residual_rms[n], unit)} RMS left"
    )
    simulated = Simulated("simulated", AFTER, overlay.simulated)
    return overlay_figure(words.sentence(title), n, overlay.t, overlay.measured, [simulated])


def _over_frequency(identification: Identification, overlay: Overlay) -> Figure:
    n = overlay.channel
    rate = float((len(overlay.t) - 1) / (overlay.t[-1] - overlay.t[0]))
    frequency, values = density(overlay.measured - overlay.simulated, rate)
    noise = identification.noise_rms[n] / float(np.sqrt(rate / 2.0))
    title = finding(frequency, values, noise, words.channel(n))
    _, measured = density(overlay.measured, rate)
    curves = [SpectrumLine("measured", MEASURED, measured), SpectrumLine("residual", AFTER, values)]
    return residual_figure(title, n, frequency, curves, noise)


def _undetermined_values(identification: Identification) -> str:
    title = "What these data cannot determine"
    others = split_off_rig(identification.remarks)[1]
    sentences = (*doubt_sentences(identification), *remark_sentences(others))
    body = bullets(sentences) if sentences else paragraph("The data determine every free value.")
    return section(title, body)


def _correlation(identification: Identification) -> str:
    names = [p.name for p in identification.parameters]
    physical = [i for i, name in enumerate(names) if not name.startswith("clock.")]
    return correlation_section(
        [names[i] for i in physical], identification.correlation[np.ix_(physical, physical)]
    )


def _footer(identification: Identification) -> list[str]:
    sources = f"Data: {', '.join(identification.sources)}"
    damage = [words.sentence(f"{line}.") for line in fault_lines(identification.faults)]
    return [
        sources,
        *damage,
        *identification.notes,
        *remark_sentences(identification.clocks),
        "rsea identify. All values in SI.",
    ]
