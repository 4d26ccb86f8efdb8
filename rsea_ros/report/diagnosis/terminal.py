"""The essence of a diagnosis on a terminal, in about ten lines."""

from __future__ import annotations

from collections.abc import Iterator

from rich.text import Text

from rsea_ros.diagnosis.result import CauseParameter, Diagnosis, Experiment, Misfit
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.page import fitted_rivals
from rsea_ros.report.remark_words import fault_lines, remark_sentences
from rsea_ros.report.rig import command, rig_named, right_rig, split_off_rig
from rsea_ros.report.wrapped_lines import LABEL, WIDTH, command_row, row, wrap

_STYLES = {"partly_explained": "bold yellow", "unexplained": "bold red"}
_MOST = 3


def terminal_lines(diagnosis: Diagnosis, width: int = WIDTH) -> list[Text]:
    """Return the verdict and the evidence, each in lines of at most `width` columns."""
    off, _ = split_off_rig(diagnosis.remarks)
    style = _STYLES.get(diagnosis.verdict, "bold yellow" if off else "bold green")
    rows = [*_rig(diagnosis, width), *(row(name, text, width) for name, text in _rows(diagnosis))]
    shown = (Text.assemble((text[:LABEL], "dim"), text[LABEL:]) for text in rows)
    return [Text(wrap(say.headline(diagnosis), width), style=style), *shown]


def _rig(d: Diagnosis, width: int) -> Iterator[str]:
    """Yield the rig, and what speaks against it."""
    yield row("rig", rig_named(d.rig_name, d.rig_choice), width)
    off, _ = split_off_rig(d.remarks)
    for sentence in remark_sentences(off):
        yield row("", sentence, width)
    if off:
        yield command_row("", right_rig(), command("identify", d.sources, d.rig_name, d.rig_choice), width)


def _rows(d: Diagnosis) -> Iterator[tuple[str, str]]:
    main = d.channel
    ratios, rms = num.residual_change(d, main), num.rms_change(d, main)
    yield "residual", f"{words.channel(main)} {ratios} times the noise ({rms})"
    if left := num.left_channel(d):
        yield "", f"{words.channel(left)} {num.residual_change(d, left)} times the noise"
    for cause in d.causes:
        yield "cause", f"{cause.name}: {', '.join(_size(name, p) for name, p in num.sizes(cause).items())}"
        gain, interval = num.percent(cause.gain_holdout), num.percent_range(cause.gain_holdout_ci95)
        yield "gain", f"{gain} of the {words.channel(cause.channel)} residual, held out (95 %: {interval})"
        yield "status", say.status_line(cause, d.alternatives, d.at_noise_floor)
    if d.misfit and d.verdict != "nothing_wrong":
        yield "wrong at", "; ".join(say.misfit(m) for m in _worst(d))
    for rival in fitted_rivals(d)[:_MOST]:
        yield "rejected", f"{rival.name}: {say.prose(say.rejection(rival))}"
    if d.rejected:
        yield "tried", f"{len(d.causes) + len(d.rejected)} causes of the catalogue"
    for sentence in (*say.confusions(d), *remark_sentences(split_off_rig(d.remarks)[1])):
        yield "unclear", sentence
    if d.next_experiment is not None:
        yield "next run" if d.next_experiment.excitation else "decides", _next(d.next_experiment)
    for line in fault_lines(d.faults):
        yield "data", line


def _next(experiment: Experiment) -> str:
    settings = say.excitation(experiment.excitation)
    return f"{say.prose(say.next_run(experiment))}{f': {settings}' if settings else ''}"


def _size(name: str, parameter: CauseParameter) -> str:
    value, doubt, unit = num.estimate(parameter)
    return f"{name.replace('_', ' ')} {value}{doubt} {unit}".rstrip()


def _worst(d: Diagnosis) -> list[Misfit]:
    """Return the worst misfit in each respect."""
    worst: dict[str, Misfit] = {}
    for m in d.misfit:
        if m.what not in worst or m.times_noise > worst[m.what].times_noise:
            worst[m.what] = m
    return sorted(worst.values(), key=lambda m: -m.times_noise)[:_MOST]
