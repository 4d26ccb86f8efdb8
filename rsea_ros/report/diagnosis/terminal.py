"""The essence of a diagnosis on a terminal, in about ten lines."""

from collections.abc import Iterator, Sequence

from rich.text import Text

from rsea_ros.diagnosis.result import Diagnosis, Misfit
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num, words as say
from rsea_ros.report.diagnosis.page import fitted_rivals
from rsea_ros.report.remark_words import fault_lines, remark_sentences
from rsea_ros.report.rig import command, rig_named, right_rig, split_off_rig
from rsea_ros.report.words import LABEL, WIDTH, command_row, row, wrap

_STYLES = {"partly_explained": "bold yellow", "unexplained": "bold red"}
_MOST = 3


def terminal_lines(diagnosis: Diagnosis, width: int = WIDTH) -> list[Text]:
    """Return the verdict and the evidence, each in lines of at most `width` columns."""
    d, (off, others) = diagnosis, split_off_rig(diagnosis.remarks)
    style = _STYLES.get(d.verdict, "bold yellow" if off else "bold green")
    rows = [row("rig", rig_named(d.rig_name, d.rig_choice), width)]
    rows += [row("", sentence, width) for sentence in remark_sentences(off)]
    if off:  # what speaks against the rig
        again = command("identify", d.sources, d.rig_name, d.rig_choice)
        rows.append(command_row("", right_rig(), again, width))
    rows += [row(name, text, width) for name, text in _rows(d, remark_sentences(others))]
    shown = (Text.assemble((text[:LABEL], "dim"), text[LABEL:]) for text in rows)
    return [Text(wrap(say.headline(d), width), style=style), *shown]


def _rows(d: Diagnosis, remarks: Sequence[str]) -> Iterator[tuple[str, str]]:
    main = d.channel
    ratios, rms = num.residual_change(d, main), num.rms_change(d, main)
    yield "residual", f"{words.channel(main)} {ratios} times the noise ({rms})"
    if left := num.left_channel(d):
        yield "", f"{words.channel(left)} {num.residual_change(d, left)} times the noise"
    for cause in d.causes:
        sizes = {n: words.measured_text(p.value, *p.ci95, p.unit) for n, p in num.sizes(cause).items()}
        shown = ", ".join(f"{name} {text}" for name, text in sizes.items()).replace("_", " ")
        yield "cause", f"{cause.name}: {shown}"
        gain, interval = num.percent(cause.gain_holdout), num.percent_range(cause.gain_holdout_ci95)
        yield "gain", f"{gain} of the {words.channel(cause.channel)} residual, held out (95 %: {interval})"
        yield "status", say.status_line(cause, d.alternatives, d.at_noise_floor)
    if d.misfit and d.verdict != "nothing_wrong":
        worst: dict[str, Misfit] = {}  # in each respect
        for m in sorted(d.misfit, key=lambda m: -m.times_noise):
            worst.setdefault(m.what, m)
        yield "wrong at", "; ".join(say.misfit(m) for m in list(worst.values())[:_MOST])
    for rival in fitted_rivals(d)[:_MOST]:
        yield "rejected", f"{rival.name}: {say.prose(say.rejection(rival))}"
    if d.rejected:
        yield "tried", f"{len(d.causes) + len(d.rejected)} causes of the catalogue"
    for sentence in (*say.confusions(d), *remarks):
        yield "unclear", sentence
    if (following := d.next_experiment) is not None:
        settings = say.excitation(following.excitation)
        run = f"{say.prose(say.next_run(following))}{f': {settings}' if settings else ''}"
        yield "next run" if following.excitation else "decides", run
    for line in fault_lines(d.faults):
        yield "data", line
