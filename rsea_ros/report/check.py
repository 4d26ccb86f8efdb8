"""The findings of a check: on a terminal, one line each, as a page, and for programs (docs/check.md)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from rsea_ros.checks.finding import Finding, Findings, worst
from rsea_ros.checks.pairs import Pair
from rsea_ros.documents.wording import list_names
from rsea_ros.outputs.files import Destination, NewFiles
from rsea_ros.records.record import UNITS, Record
from rsea_ros.records.stamps import repair_stamps
from rsea_ros.report import page as html, result_files as outputs, words
from rsea_ros.report.figures.figure import BEFORE, MEASURED, QUIET, Figure, axis, label, layout, line
from rsea_ros.report.figures.overlay import extremes
from rsea_ros.report.remark_words import rig_in_brackets
from rsea_ros.report.result_files import Provenance, pick, strict
from rsea_ros.report.words import WIDTH, wrap

_LIGHT, _KIND, _CHANNEL = 7, 14, 25
"""Columns."""
_STYLES = {"green": "green", "amber": "yellow", "red": "bold red"}
_KINDS = {"wrong_rig": "rig fits", "identifiability": "determined", "rig_value": "rig's value?",
          "missing_topic": "missing"}  # fmt: skip
_DOUBTED = {"wrong_rig": "wrong rig?", "identifiability": "undetermined"}
"""Names of kinds whose plain name would say the opposite of an amber or red light."""
SAID_ELSEWHERE = ("identifiability", "rig_value", "noise", "excitation", "rest")
"""Kinds that identify and diagnose speak of in their results anyway; not a command that never changes."""


def check_lines(findings: Findings, width: int = WIDTH) -> Iterator[Text]:
    """Return the findings of a record, each in lines of at most `width` columns: light, kind, channel, value.

    The expected value and the remedy follow where a light is not green.
    """
    for f in _each_remedy_once(findings.findings):
        head = f"{f.light:<{_LIGHT}}{f'{kind(f)} ':<{_KIND}}{f'{_channel(f)} ':<{_CHANNEL}}"
        text = wrap(f"{head}{_said(f)}", width, min(len(head), _LIGHT + _KIND + _CHANNEL))
        yield Text.assemble((text[:_LIGHT], _STYLES[f.light]), text[_LIGHT:])


def warnings(findings: Findings) -> list[str]:
    """Return a line for each amber or red finding that a fit's results would not repeat; rig first."""
    reported = {(f.kind, f.channel) for f in findings.faults}
    chosen = [
        f for f in findings.findings
        if f.light != "green" and (f.kind not in SAID_ELSEWHERE or (f.kind, f.light) == ("excitation", "red"))
        and (f.kind == "wrong_rig" or (f.kind, f.channel) not in reported)
    ]  # fmt: skip
    return [sentence(f) for f in _each_remedy_once(sorted(chosen, key=lambda f: f.kind != "wrong_rig"))]


def _each_remedy_once(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings, each without a remedy that one before it has named."""
    named: set[str] = set()
    for f in findings:
        yield replace(f, remedy="") if f.remedy in named else f
        named.add(f.remedy)


def sentence(f: Finding) -> str:
    """Return a finding as one line."""
    return f"{' '.join(filter(None, (f'{f.light}:', kind(f), _channel(f))))}: {_said(f)}"


def _said(f: Finding) -> str:
    """Return number and detail; where the light is not green, what is expected and the remedy too."""
    found = (" " if f.unit == "1" else ", ").join(filter(None, (number(f), f.detail)))
    more = () if f.light == "green" else (f.expected and f"expected {f.expected}", f.remedy)
    return "; ".join(filter(None, (found, *more)))


def kind(f: Finding) -> str:
    """Return the plain name of a kind of finding."""
    if f.light != "green" and f.kind in _DOUBTED:
        return _DOUBTED[f.kind]
    return _KINDS.get(f.kind, f.kind.replace("_", " "))


def number(f: Finding) -> str:
    """Return the number of a finding with its interval and unit."""
    if f.value is None:
        return ""
    shown = f"{f.value:.0f}" if f.kind == "topics" else words.number(f.value, 3)
    if f.low is not None and f.high is not None:
        shown = "".join(words.with_doubt(f.value, f.low, f.high))
    return f"{shown} {words.unit(f.unit)}".rstrip()


def _channel(f: Finding) -> str:
    return words.channel(f.channel) if f.channel in words.CHANNELS else f.channel


def summary(checks: Sequence[Findings]) -> str:
    """Return one line that counts the lights."""
    lights = [f.light for c in checks for f in c.findings]
    counts = ", ".join(f"{lights.count(light)} {light}" for light in ("red", "amber", "green"))
    first = checks[0]
    return f"checked against {rig_in_brackets(first.rig_name, first.rig_choice)}: {counts}"


def check_json(checks: Sequence[Findings]) -> dict[str, Any]:
    """Return the contents of the JSON of `rsea check`; infinite numbers and NaN are null."""
    first = checks[0]
    return {
        "schema": 1,
        **pick(first, "rig=rig_name"),
        "rig_option": first.rig_choice.option or None,
        "rig_is_default": first.rig_choice.is_default,
        "light": worst([c.light for c in checks]),
        "records": [
            {**pick(c, "bag=source light"), "findings": [_finding(f) for f in c.findings],
             "faults": [outputs.fault_json(f) for f in c.faults], "pairs": [_pair(p) for p in c.pairs]}
            for c in checks
        ],
    }  # fmt: skip


def _finding(f: Finding) -> dict[str, Any]:
    interval = None if f.low is None or f.high is None else strict([f.low, f.high])
    return {**pick(f, "light kind channel value unit"), "ci95": interval, **pick(f, "expected detail remedy")}


def _pair(p: Pair) -> dict[str, Any]:
    """Return a pair by the names of the contract: factor of y on x, lag of y behind x, s; from, to in s."""
    return {"channels": [p.law.y, p.law.x], **pick(p, "factor sign lag coherence from=start to=stop")}


def write_check(
    checks: Sequence[Findings], records: Sequence[Record], out: Destination, provenance: Provenance
) -> Path:
    """Write check.json and report.html, and return the report's path: both or none."""
    with NewFiles(out) as new:
        new.write(outputs.CHECK_JSON, outputs.json_text(check_json(checks), provenance))
        return new.write(outputs.REPORT, check_report(checks, records, provenance))


def check_report(
    checks: Sequence[Findings], records: Sequence[Record], provenance: Provenance | None = None
) -> str:
    """Return the page of a check: what to put right, the channels over time, what they say of each other."""
    findings = [f for c in checks for f in c.findings]
    every = [(f.light, " of the ".join(filter(None, (kind(f), _channel(f))))) for f in findings]
    red, amber = ([name for of, name in every if of == light] for light in ("red", "amber"))
    title = "Nothing stands against a fit"
    if worse := list(dict.fromkeys(red or amber)):
        title = f"{'Put right' if red else 'Look at'} before a fit: {list_names(worse)}"
    blocks = (block for c, r in zip(checks, records, strict=True) for block in _blocks(c, r))
    return html.page(title, f"Check of {', '.join(c.source for c in checks)}", blocks,
                     [f"{summary(checks)}. rsea check. All values in SI."], provenance)  # fmt: skip


def _blocks(c: Findings, record: Record) -> Iterator[html.Block]:
    told = list(_each_remedy_once(c.findings))
    if wrong := [f for light in ("red", "amber") for f in told if f.light == light]:
        yield html.section(f"{c.source}: {c.light}", html.listed(
            wrong, ("light", lambda f: f.light), *_COLUMNS, ("expected", lambda f: f.expected),
            ("what to do", lambda f: f.remedy),
        ))  # fmt: skip
    yield _over_time(c, record)
    if pairs := [p for p in c.pairs if not p.unrelated]:
        caption = "What two channels say of each other, span by span, before any rig is believed."
        yield html.section("Channel against channel", html.listed(pairs, *_OF_A_PAIR), caption=caption)
    if right := [f for f in told if f.light == "green"]:
        yield html.fold(f"{len(right)} properties are as a fit needs them", html.listed(right, *_COLUMNS))


_COLUMNS = (
    ("property", kind), ("channel", _channel), ("#value", number), ("what and where", lambda f: f.detail),
)  # fmt: skip
_OF_A_PAIR = (
    ("channels", lambda p: f"{words.channel(p.law.y)} against {words.channel(p.law.x)}"),
    ("#from, s", lambda p: f"{p.start:.1f}"), ("#to, s", lambda p: f"{p.stop:.1f}"),
    ("#factor", lambda p: words.number(p.factor, 3)),
    ("#late by, ms", lambda p: words.number(1e3 * p.lag, 3)),
    ("#in common", lambda p: f"{100.0 * p.coherence:.0f} %"),
)  # fmt: skip
_MOST = 1600
"""Samples of a drawn channel: more than a screen has columns for."""


def _over_time(c: Findings, record: Record) -> Figure:
    """Return every channel at its repaired stamps, which the masks have; what must not count is orange."""
    record, _ = repair_stamps(record)
    parts, data, names, height = {}, [], [], 1.0 / len(record.channels)
    for k, (name, channel) in enumerate(record.channels.items()):
        mark = "" if k == 0 else str(k + 1)
        top = 1.0 - k * height
        parts[f"yaxis{mark}"] = axis(words.unit(UNITS[name]), domain=[top - 0.8 * height, top])
        above = {"xref": "paper", "yref": "paper", "yanchor": "bottom"}
        names.append(label(words.channel(name), 0.0, top, QUIET, **above))
        masked = c.masked.get(name, np.zeros(len(channel.t), dtype=bool))
        for values, colour in ((channel.y, MEASURED), (np.where(masked, channel.y, np.nan), BEFORE)):
            if colour == MEASURED or masked.any():
                hover = f"%{{y:.4g}} {words.unit(UNITS[name])}"
                keep = extremes(_MOST, values)
                data.append(line(channel.t[keep], values[keep], words.channel(name), colour, 1.0,
                                 yaxis=f"y{mark}", hovertemplate=hover))  # fmt: skip
    last = f"y{len(record.channels)}" if len(record.channels) > 1 else "y"
    drawn = layout(xaxis=axis("time, s", anchor=last), annotations=names, **parts,
                   margin={"l": 72, "r": 24, "t": 24, "b": 48})  # fmt: skip
    left_out = any(mask.any() for mask in c.masked.values())
    caption = "Orange: samples that must not count." if left_out else "Least and largest value each moment."
    return Figure("Every channel over time", caption, data, drawn, 110 * len(record.channels) + 60)
