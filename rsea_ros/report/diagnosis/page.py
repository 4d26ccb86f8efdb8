"""The report of a diagnosis, as one HTML file."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.causes import cause_section, tried_section
from rsea_ros.report.diagnosis.figures import spectrum_figure, time_figure
from rsea_ros.report.diagnosis.profile import profiles
from rsea_ros.report.diagnosis.settings import settings_section
from rsea_ros.report.diagnosis.sketch import sketch, upright_sketch
from rsea_ros.report.diagnosis.tables import channel_section, experiment_section
from rsea_ros.report.diagnosis.where import where_figure
from rsea_ros.report.fault_words import fault_lines, faults
from rsea_ros.report.figures.palette import AFTER, BEFORE
from rsea_ros.report.identification.parameters import parameter_table
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, fold, key_numbers, paragraph, section
from rsea_ros.report.provenance import Provenance
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.rig.page import right_rig_block
from rsea_ros.report.rig.words import command, rig_named, split_off_rig


def diagnosis_report(diagnosis: Diagnosis, provenance: Provenance | None = None) -> str:
    """Return the report as HTML that opens offline."""
    d = diagnosis
    footer = [f"Data: {', '.join(d.sources)}", "rsea diagnose. All values in SI."]
    footer += provenance.lines if provenance else ()
    return page(say.headline(d), _kicker(d), list(_blocks(d)), footer)


def _blocks(d: Diagnosis) -> Iterator[Block]:
    """Yield the page from top to bottom: the verdict first, then the evidence."""
    main = d.channel
    yield key_numbers(_keys(d, main))
    yield right_rig_block(d.remarks, command("identify", d.sources, d.rig_name, d.rig_choice))
    if d.faults:
        yield f'<p class="next">{escape(faults(d.faults))}</p>'
    names = [c.name for c in d.causes]
    yield sketch(names) + upright_sketch(names)
    yield from (spectrum_figure(d, s) for s in d.spectra if s.channel == main)
    if any(o.channel == main for o in d.before):
        yield time_figure(d, main)
    where = profiles(d, main)
    if where:
        yield where_figure(where, bool(d.causes), AFTER if d.at_noise_floor and not d.causes else BEFORE)
    yield from (cause_section(c, d) for c in d.causes)
    yield _final(d)
    yield tried_section(d)
    yield channel_section(d)
    yield _undetermined_values(d)
    if d.next_experiment is not None:
        yield experiment_section(d.next_experiment)
    yield _faults(d)
    yield _baseline(d)
    yield settings_section(d.settings)


def _keys(d: Diagnosis, main: str) -> list[tuple[str, str]]:
    """Return the numbers of the first screen."""
    channel = words.channel(main)
    if d.causes:
        removed = (num.percent(num.gain(d, main)), f"of the {channel} residual removed, on held-out data")
        return [removed, (num.residual_change(d, main), "times the noise, before and after")]
    keys = [(num.residual_change(d, main), f"times the noise is the {channel} residual")]
    if d.rejected:
        keys.append((str(len(d.rejected)), "causes tried, none accepted"))
    return [*keys, (f"{d.extended_fit_percent[main]:.2f} %", f"of the {channel} explained")]


def _kicker(d: Diagnosis) -> str:
    rig = rig_named(d.rig_name, d.rig_choice)
    return f"Diagnosis of {rig} · {d.duration:.0f} s of data at {d.rate:.0f} Hz"


def _undetermined_values(d: Diagnosis) -> str:
    sentences = [*say.confusions(d), *remark_sentences(split_off_rig(d.remarks)[1])]
    body = bullets(sentences) if sentences else paragraph("The data determine every free value.")
    return section("What these data cannot determine", body)


def _faults(d: Diagnosis) -> str:
    if not d.faults:
        return section(
            "No fault was found in the data", paragraph("No sample is missing, frozen or clipped.")
        )
    items = bullets([words.sentence(f"{line}.") for line in fault_lines(d.faults)])
    caption = "These faults were found before any fit. Faulty samples are masked, never explained by physics."
    return section("Faults of the data", items, caption=caption)


def _baseline(d: Diagnosis) -> str:
    """Return the values fitted before the causes, folded: they compensate the missing causes."""
    title = "Values of the rig, fitted before the search for causes"
    return fold(title, parameter_table(d.baseline)) if d.causes else ""


def _final(d: Diagnosis) -> str:
    """Return the rig's values at the end: beside all causes, where there are any."""
    title = "Values of the rig together with the causes" if d.causes else "Values of the rig"
    return section(title, parameter_table(d.final))
