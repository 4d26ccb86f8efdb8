"""The report of a diagnosis, as one HTML file: the verdict first, then the evidence."""

import math
from collections.abc import Iterator
from html import escape

from rsea_ros.diagnosis.result import Cause, Diagnosis, Experiment, Rejected
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.documents.wording import list_names
from rsea_ros.identification.settings import Setting
from rsea_ros.records.record import UNITS
from rsea_ros.report import page as html, words
from rsea_ros.report.diagnosis import numbers as num, words as say
from rsea_ros.report.diagnosis.figures import sketch, spectrum_figure, time_figure
from rsea_ros.report.diagnosis.where import profiles, where_figure
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, MEASURED, faint
from rsea_ros.report.identification.page import parameter_table, undetermined_section
from rsea_ros.report.remark_words import fault_lines, found_faults, remark_sentences
from rsea_ros.report.result_files import Provenance
from rsea_ros.report.rig import command, rig_named, right_rig_block, split_off_rig

_EXCITE = ("kind", "amplitude", "noise", "low", "high", "period", "duration", "rate", "seed")
"""Settings that are parameters of the node excite."""
_DEFAULTS = {s.name: s.value for s in DEFAULT.numbers()}


def diagnosis_report(diagnosis: Diagnosis, provenance: Provenance | None = None) -> str:
    """Return the report as HTML that opens offline."""
    d = diagnosis
    footer = [f"Data: {', '.join(d.sources)}", "rsea diagnose. All values in SI."]
    rig = rig_named(d.rig_name, d.rig_choice)
    kicker = f"Diagnosis of {rig} · {d.duration:.0f} s of data at {d.rate:.0f} Hz"
    return html.page(say.headline(d), kicker, _blocks(d), footer, provenance)


def _blocks(d: Diagnosis) -> Iterator[html.Block]:
    main = d.channel
    yield html.key_numbers(_keys(d, words.channel(main)))
    yield right_rig_block(d.remarks, command("identify", d.sources, d.rig_name, d.rig_choice))
    yield html.paragraph(found_faults(d.faults).strip(), "next")
    yield sketch([c.name for c in d.causes])
    yield from (spectrum_figure(d, s) for s in d.spectra if s.channel == main)
    if any(o.channel == main for o in d.before):
        yield time_figure(d, main)
    if where := profiles(d, main):
        yield where_figure(where, bool(d.causes), AFTER if d.at_noise_floor and not d.causes else BEFORE)
    yield from (_cause(c, d) for c in d.causes)
    together = " together with the causes" if d.causes else ""
    yield html.section(f"Values of the rig{together}", parameter_table(d.final))
    yield _tried(d)
    yield _channels(d)
    yield undetermined_section([*say.confusions(d), *remark_sentences(split_off_rig(d.remarks)[1])])
    if d.next_experiment is not None:
        yield _experiment(d.next_experiment)
    yield _faults(d)
    if d.causes:  # folded: without the causes they compensate them
        yield html.fold("Values of the rig, fitted before the search for causes", parameter_table(d.baseline))
    yield settings_section(d.settings)


def _keys(d: Diagnosis, channel: str) -> list[tuple[str, str]]:
    change = num.residual_change(d, d.channel)
    if d.causes:
        removed = f"of the {channel} residual removed, on held-out data"
        return [(num.percent(num.gain(d, d.channel)), removed), (change, "times the noise, before and after")]
    tried = [(str(len(d.rejected)), "causes tried, none accepted")] if d.rejected else []
    explained = (f"{d.extended_fit_percent[d.channel]:.2f} %", f"of the {channel} explained")
    return [(change, f"times the noise is the {channel} residual"), *tried, explained]


def _cause(cause: Cause, d: Diagnosis) -> html.Html:
    """Return a cause with its size, its certainty, and the evidence for it."""
    share = f"{num.percent(cause.gain_holdout)} of the {words.channel(cause.channel)} residual"
    how_sure = status = say.status_line(cause, d.alternatives, d.at_noise_floor)
    how_sure = words.sentence(f"{say.prose(status)}.")
    interval, train = num.percent_range(cause.gain_holdout_ci95), num.percent(cause.gain_train)
    rivals = list_names([words.effect(n) for n in cause.confusable_with])
    sizes = []
    for name, p in num.sizes(cause).items():
        value, doubt, unit = words.measured(p.value, *p.ci95, p.unit)
        small = f" <small>{doubt.strip()}</small>" if doubt else ""
        model = f", of which the simulation ± {num.model_half_width(p)}" if p.model_sd > 0.0 else ""
        label = f"{name.replace('_', ' ')}, 95 % interval{model}"
        sizes.append((html.Html(f"{value}{small} {escape(unit)}"), label))
    return html.section(
        words.sentence(f"{words.effect(cause.name)}: {share}"), html.key_numbers(sizes), how_sure,
        html.equation(cause.equation) if cause.equation else "", say.evidence(cause),
        f"95 % interval of that gain: {interval}; on the training data it is {train}.",
        f"These data do not distinguish it from {rivals}." if rivals else "",
    )  # fmt: skip


def _tried(d: Diagnosis) -> html.Html:
    """Return all effects tried: causes and fitted rivals with their gains, then the others by reason."""
    if not (d.causes or d.rejected):
        return html.Html()
    shown: list[tuple[Cause | Rejected, str]] = [(c, c.status.replace("_", " ")) for c in d.causes]
    shown += [(r, say.rejection(r)) for r in fitted_rivals(d)]
    others: dict[str, list[str]] = {}
    for r in d.rejected:
        if not r.is_fitted:
            others.setdefault(say.rejection(r), []).append(words.effect(r.name))
    reasons = [f"{words.sentence(say.prose(why))}: {list_names(sorted(n))}." for why, n in others.items()]
    ground = faint(GRID, 0.5)
    rows = [
        [html.named(words.sentence(words.effect(item.name)), item.name, k < len(d.causes)),
         num.percent(item.gain_holdout),
         html.bar(item.gain_holdout, AFTER if k < len(d.causes) else faint(MEASURED, 0.6), ground),
         say.prose(outcome)]
        for k, (item, outcome) in enumerate(shown)
    ]  # fmt: skip
    return html.section(
        f"{len(d.causes) + len(d.rejected)} causes were tried, {len(d.causes) or 'none'} accepted",
        html.table(("Cause", "#Gain", "", "Outcome"), rows) if rows else "",
        html.bullets(reasons),
        caption="Gain: share of the residual that the cause removes, on held-out data.",
    )


def fitted_rivals(diagnosis: Diagnosis) -> list[Rejected]:
    """Return the effects that were fitted to all training data and rejected, largest gain first."""
    fitted = (r for r in diagnosis.rejected if r.is_fitted)
    return sorted(fitted, key=lambda r: -r.gain_holdout if math.isfinite(r.gain_holdout) else math.inf)


def _channels(d: Diagnosis) -> html.Html:
    changed = ("#Residual before", "#after", "#Times the noise before", "#after")
    head = ("Channel", "#Noise, RMS", *(changed if d.causes else ("#Residual, RMS", "#Times the noise")))
    rows, stages = [], 2 if d.causes else 1
    for name, unit in ((n, UNITS[n]) for n in d.residual_rms):
        rms = [words.quantity(v[name], unit) for v in (d.noise_rms, d.residual_rms, d.extended_residual_rms)]
        ratios = [words.number(v, 3) for v in num.times_noise(d, name)]
        rows.append([words.sentence(words.channel(name)), *rms[: 1 + stages], *ratios[:stages]])
    reached = "All channels are" if d.at_noise_floor else "Not all channels are"
    return html.section(f"{reached} at their noise", html.table(head, rows), caption="On held-out data.")


def _experiment(experiment: Experiment) -> html.Html:
    """Return the purpose of the next run, its settings, and the command that plays it."""
    given, settings = experiment.excitation, words.sentence(say.excitation(experiment.excitation))
    options = " ".join(f"-p {k}:={given[k]}" for k in _EXCITE if k in given)
    play = html.Html(f"<p class='under'>{html.code(f'ros2 run rsea_ros excite --ros-args {options}')}</p>")
    playable = (
        "kind" in given and given.get("unit") == UNITS["command"]
    )  # excite plays torques, not positions
    return html.section(
        "The run that would decide" if given else "What would decide",
        say.prose(say.next_run(experiment)),
        f"{settings}." if settings else "",
        play if playable else "",
    )


def _faults(d: Diagnosis) -> html.Html:
    if not d.faults:
        return html.section("No fault was found in the data", "No sample is missing, frozen or clipped.")
    items = html.bullets([words.sentence(f"{line}.") for line in fault_lines(d.faults)])
    caption = "These faults were found before any fit. Faulty samples are masked, never explained by physics."
    return html.section("Faults of the data", items, caption=caption)


def settings_section(settings: DiagnosisSettings) -> html.Html:
    """Return every number that steered the verdict, folded; those that are not the default stand out."""
    limits = f"At most {settings.max_causes} causes."
    if settings.without:
        limits += f" Not tried: {', '.join(settings.without)}."
    shown = html.listed(
        settings.numbers(), ("Setting", lambda s: html.code(s.name)), ("#Value", _setting_value),
        ("Meaning", lambda s: s.meaning), ("Why this value", lambda s: s.reason),
    )  # fmt: skip
    return html.fold("Settings: the numbers that steer the verdict", limits, shown)


def _setting_value(s: Setting) -> html.Html:
    value, default = escape(f"{value_text(s.value)} {words.unit(s.unit)}".strip()), _DEFAULTS[s.name]
    return html.Html(value if s.value == default else f"<b>{value}</b> (default {value_text(default)})")


def value_text(value: float | tuple[float, ...]) -> str:
    """Return a setting's number, or its numbers, as text."""
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"
