"""A diagnosis as files, all or none: the page, diagnosis.json, overlay.mcap and the extended model."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Experiment, Rejected
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, Setting
from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import Overlay
from rsea_ros.identification.unknowns import CLOCK, CLOCK_REACH
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.files import Destination, NewFiles
from rsea_ros.records.record import UNITS, Channel, Record
from rsea_ros.records.statistics import Z95
from rsea_ros.report import page as html, remark_words as remarks, result_files as outputs, words
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.figures import profiles, sketch, spectrum_figure, time_figure, where_figure
from rsea_ros.report.figures.figure import AFTER, BEFORE, GRID, MEASURED, faint
from rsea_ros.report.identification import parameter_table, parameters_json, undetermined_section
from rsea_ros.report.result_files import Provenance, pick

_EXCITE = ("kind", "amplitude", "noise", "low", "high", "period", "duration", "rate", "seed")
"""Settings that are parameters of the node excite."""
_DEFAULTS = {s.name: s.value for s in DEFAULT.numbers()}


def diagnosis_report(diagnosis: Diagnosis, provenance: Provenance | None = None) -> str:
    """Return the report as HTML that opens offline."""
    d = diagnosis
    footer = [f"Data: {', '.join(d.sources)}", "rsea diagnose. All values in SI."]
    rig = remarks.rig_named(d.rig_name, d.rig_choice)
    kicker = f"Diagnosis of {rig} · {d.duration:.0f} s of data at {d.rate:.0f} Hz"
    return html.page(say.headline(d), kicker, _blocks(d), footer, provenance)


def _blocks(d: Diagnosis) -> Iterator[html.Block]:
    main = d.channel
    yield html.key_numbers(_keys(d, words.channel(main)))
    yield remarks.right_rig_block(d.remarks, remarks.command("identify", d.sources, d.rig_name, d.rig_choice))
    yield html.paragraph(remarks.found_faults(d.faults).strip(), "next")
    yield sketch([c.name for c in d.causes])
    yield from (spectrum_figure(d, s) for s in d.spectra if s.channel == main)
    if any(o.channel == main for o in d.before):
        yield time_figure(d, main)
    if where := profiles(d, main):
        yield where_figure(where, bool(d.causes), AFTER if d.at_noise_floor and not d.causes else BEFORE)
    yield from (_cause(c, d) for c in d.causes)
    if d.edit is not None:
        yield html.section("The edited machine", words.sentence(f"{say.edit_sentence(d.edit)}."))
    if d.smallest:
        yield _smallest(d)
    together = " together with the causes" if d.causes else ""
    yield html.section(f"Values of the rig{together}", parameter_table(d.final))
    yield _tried(d)
    yield _channels(d)
    yield undetermined_section(say.confusions(d), d.remarks)
    if d.next_experiment is not None:
        yield _experiment(d.next_experiment)
    yield _faults(d)
    if d.causes:  # folded: without the causes they compensate them
        yield html.fold("Values of the rig, fitted before the search for causes", parameter_table(d.baseline))
    yield settings_section(d.settings)


def _keys(d: Diagnosis, channel: str) -> list[tuple[str, str]]:
    change = say.residual_change(d, d.channel)
    if d.causes:
        before, after = (rms[d.channel] for rms in (d.residual_rms, d.extended_residual_rms))
        gain = 1.0 - after / before if before > 0.0 else 0.0
        what = "of the {} residual removed" if gain >= 0.0 else "more {} residual than before"
        key = (say.percent(abs(gain)), f"{what.format(channel)}, on held-out data")
        return [key, (change, "times the noise, before and after")]
    tried = [(str(len(d.rejected)), "causes tried, none accepted")] if d.rejected else []
    explained = (f"{d.extended_fit_percent[d.channel]:.2f} %", f"of the {channel} explained")
    return [(change, f"times the noise is the {channel} residual"), *tried, explained]


def _cause(cause: Cause, d: Diagnosis) -> html.Html:
    """Return a cause with its size, its certainty, and the evidence for it."""
    share = f"{say.percent(cause.gain_holdout)} of the {words.channel(cause.channel)} residual"
    how_sure = words.sentence(say.prose(say.status_line(cause, d.alternatives, d.at_noise_floor)))
    interval, train = say.percent_range(cause.gain_holdout_ci95), say.percent(cause.gain_train)
    sizes = []
    for name, p in say.sizes(cause).items():
        value, doubt, unit = words.measured(p.value, *p.ci95, p.unit)
        small = f" <small>{doubt.strip()}</small>" if doubt else ""
        side = words.number(Z95 * p.model_sd * words.unit_factor(p.value, p.unit)[0], 2)
        model = f", of which the simulation ± {side} {unit}".rstrip() if p.model_sd > 0.0 else ""
        label = f"{name.replace('_', ' ')}, 95 % interval{model}"
        sizes.append((html.Html(f"{value}{small} {escape(unit)}"), label))
    return html.section(
        words.sentence(f"{words.effect(cause.name)}: {share}"), html.key_numbers(sizes), f"{how_sure}.",
        html.equation(cause.equation) if cause.equation else "", say.evidence(cause),
        f"95 % interval of that gain: {interval}; on the training data it is {train}.",
        f"Look at: {look}." if (look := say.inspection(cause.name)) else "",
    )  # fmt: skip


def _tried(d: Diagnosis) -> html.Html:
    """Return all effects tried: causes and fitted rivals with their gains, then the others by reason."""
    if not (d.causes or d.rejected):
        return html.Html()
    shown: list[tuple[Cause | Rejected, str]] = [(c, c.status.replace("_", " ")) for c in d.causes]
    shown += [(r, say.rejection(r)) for r in say.fitted_rivals(d)]
    others: dict[str, list[str]] = {}
    for r in d.rejected:
        if not r.is_fitted:
            others.setdefault(say.rejection(r), []).append(words.effect(r.name))
    reasons = [f"{words.sentence(say.prose(why))}: {list_names(sorted(n))}." for why, n in others.items()]
    ground = faint(GRID, 0.5)
    rows = [
        [html.named(words.sentence(words.effect(item.name)), item.name, k < len(d.causes)),
         say.percent(item.gain_holdout),
         html.bar(item.gain_holdout, AFTER if k < len(d.causes) else faint(MEASURED, 0.6), ground),
         say.prose(outcome)]
        for k, (item, outcome) in enumerate(shown)
    ]  # fmt: skip
    return html.section(
        f"{say.tried(d)} were tried, {len(d.causes) or 'none'} accepted",
        html.table(("Cause", "#Gain", "", "Outcome"), rows) if rows else "",
        html.bullets(reasons),
        caption="Gain: share of the residual that the cause removes, on held-out data.",
    )


def _smallest(d: Diagnosis) -> html.Html:
    """Return the smallest size of each effect that the recording would have shown."""
    shown = html.listed(
        d.smallest,
        ("Effect", lambda s: html.named(words.sentence(words.effect(s.name)), s.name)),
        ("Size", lambda s: s.parameter.replace("_", " ")),
        ("#Shown from", lambda s: say.size_text(s)),
    )
    return html.section(
        "The smallest changes that this recording would have shown", shown,
        caption="Each is put into the model and grown until a channel's residual is 4 % above its noise, "
        "although every value of the fit answers it; half as large again it is found. At no size: the fit "
        "answers it.",
    )  # fmt: skip


def _channels(d: Diagnosis) -> html.Html:
    changed = ("#Residual before", "#after", "#Times the noise before", "#after")
    head = ("Channel", "#Noise, RMS", *(changed if d.causes else ("#Residual, RMS", "#Times the noise")))
    rows, stages = [], 2 if d.causes else 1
    for name, unit in ((n, UNITS[n]) for n in d.residual_rms):
        rms = [words.quantity(v[name], unit) for v in (d.noise_rms, d.residual_rms, d.extended_residual_rms)]
        ratios = [words.number(v, 3) for v in say.times_noise(d, name)]
        rows.append([words.sentence(words.channel(name)), *rms[: 1 + stages], *ratios[:stages]])
    reached = "All channels are" if d.at_noise_floor else "Not all channels are"
    return html.section(f"{reached} at their noise", html.table(head, rows), caption="On held-out data.")


def _experiment(experiment: Experiment) -> html.Html:
    """Return the purpose of the next run, its settings, and the command that plays it."""
    given, settings = experiment.excitation, words.sentence(say.excitation(experiment.excitation))
    options = " ".join(f"-p {k}:={given[k]}" for k in _EXCITE if k in given)
    play = html.Html(f"<p class='under'>{html.code(f'ros2 run rsea_ros excite --ros-args {options}')}</p>")
    # excite plays torques, not positions
    playable = "kind" in given and given.get("unit") == UNITS["command"]
    return html.section(
        "The run that would decide" if given else "What would decide",
        say.prose(say.next_run(experiment)),
        f"{settings}." if settings else "",
        play if playable else "",
    )


def _faults(d: Diagnosis) -> html.Html:
    if not d.faults:
        return html.section("No fault was found in the data", "No sample is missing, frozen or clipped.")
    items = html.bullets([words.sentence(f"{line}.") for line in remarks.fault_lines(d.faults)])
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


NAMESPACES = ("/rsea", "/rsea/simulated_before", "/rsea/simulated_after")
"""Of the three sets of topics in overlay.mcap: measured, simulated without the causes and with them."""
OverlayWriter = Callable[[Mapping[str, Record], Path], None]
"""Writes records by namespace into one bag file: msg_adapters.records.write_overlay."""


def write_diagnosis(
    diagnosis: Diagnosis, record: Record, out: Destination | str | Path, write: OverlayWriter,
    provenance: outputs.Provenance | None = None,
) -> Path:  # fmt: skip
    """Write diagnosis.json, model.yaml, overlay.mcap and report.html, and return the report's path.

    record: the first one diagnosed, as it was read. Raises OutputError for a name that is taken, OSError or
    BagError where something cannot be written.
    """
    with NewFiles(out) as new:
        new.write(outputs.DIAGNOSIS_JSON, outputs.json_text(diagnosis_json(diagnosis), provenance))
        new.write(outputs.MODEL, rig_text(diagnosis.extended_rig))
        write(overlay_records(diagnosis, record), new.stage(outputs.OVERLAY))
        return new.write(outputs.REPORT, diagnosis_report(diagnosis, provenance))


def overlay_records(diagnosis: Diagnosis, record: Record) -> Mapping[str, Record]:
    """Return by namespace the record as it was read, and both simulations of its channels.

    record: the first one diagnosed. Simulations have the stamps that the diagnosis used, which are the
    record's own but for repaired faults of the clock.
    """

    def simulated(overlays: Sequence[Overlay]) -> Record:
        channels = {o.channel: Channel(o.t, o.simulated) for o in overlays}
        return Record(channels, record.source, record.epoch_ns)

    records = (record, simulated(diagnosis.before), simulated(diagnosis.after))
    return dict(zip(NAMESPACES, records, strict=True))


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the contents of diagnosis.json; infinite numbers and NaN are null."""
    d, numbers = diagnosis, {s.name: outputs.strict(s.value) for s in diagnosis.settings.numbers()}
    following, misfit = d.next_experiment, "what from=low to=high unit times_noise channel"
    stuck = {name for r in d.remarks if r.code == "at_bound" for name in r.names}
    far = {p.name for p in d.final if abs(p.spreads_off) > 0.999 * CLOCK_REACH}
    stuck |= {name for name in far if name.startswith(f"{CLOCK}.")}
    others = [
        {**pick(a, "name instead_of probability channel"), "parameters": _sizes(a),
         "gain": pick(a, "holdout=gain_holdout holdout_ci95=gain_holdout_ci95")}
        for a in d.alternatives
    ]  # fmt: skip
    return {
        "schema": 1,
        "rig": d.rig_name,
        **remarks.rig_json(d.rig_choice, d.remarks),
        **pick(d, "verdict channel"),
        "sentence": say.diagnosis_sentence(d),
        "data": {**pick(d, "bags=sources duration_s=duration rate_hz=rate"),
                 "faults": [outputs.fault_json(f) for f in d.faults]},
        "baseline": {"parameters": parameters_json(d.baseline),
                     **pick(d, "residual_rms noise_rms fit_percent")},
        "misfit": [pick(m, misfit) for m in d.misfit],
        "causes": [
            {**_cause_json(c), "alternatives": [a for a in others if a["instead_of"] == c.name]}
            for c in d.causes
        ],
        "alternatives": others,
        "rejected": [
            {**pick(r, "name gain_holdout"), "why": say.rejection(r), "reason": r.reason,
             "rival": r.rival or None, **pick(r, "fitted=is_fitted probability")}
            for r in d.rejected
        ],
        "extended": {
            "parameters": parameters_json(d.final),
            **pick(d, "residual_rms=extended_residual_rms fit_percent=extended_fit_percent at_noise_floor"),
            "misfit": [pick(m, misfit) for m in d.remaining],
        },
        "smallest_changes": [pick(s, "name parameter value unit") for s in d.smallest],
        "nuisance": [
            {**pick(p, "name value unit stated=start spreads_off"), "at_bound": p.name in stuck}
            for p in d.final if p.value != p.start
        ],
        "why_stopped": d.why_stopped,
        "edit": d.edit and {
            **vars(d.edit), "outcome": d.edit.outcome, "survived": d.edit.survived,
            "faults": [outputs.fault_json(f) for f in d.edit.faults],
        },
        "next_experiment": following and {"why": say.next_run(following), **pick(following, "excitation")},
        "statements": list(remarks.remark_sentences(d.remarks)),
        "settings": {**pick(d.settings, "max_causes without"), **numbers},
    }  # fmt: skip


def _cause_json(cause: Cause) -> dict[str, Any]:
    return {
        **pick(cause, "name status probability channel"),
        "parameters": _sizes(cause),
        "gain": pick(cause, "train=gain_train holdout=gain_holdout holdout_ci95=gain_holdout_ci95"),
        "evidence": say.evidence(cause),
        **pick(cause, "equation confusable_with"),
        "inspect": say.inspection(cause.name),
    }


def _sizes(cause: Cause | Alternative) -> dict[str, Any]:
    return {n: pick(p, "value unit ci95 statistical_ci95 model_sd") for n, p in cause.parameters.items()}
