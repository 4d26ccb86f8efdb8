"""The findings of a check: on a terminal, one line each, and for programs (docs/check.md)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from rich.text import Text

from rsea_ros.checks.finding import Finding, Findings, worst
from rsea_ros.checks.pairs import Pair
from rsea_ros.report import words
from rsea_ros.report.result_files import fault_json, pick, strict
from rsea_ros.report.rig import rig_in_brackets
from rsea_ros.report.words import WIDTH, wrap

SCHEMA = 1
_LIGHT, _KIND, _CHANNEL = 7, 14, 25
"""Columns."""
_STYLES = {"green": "green", "amber": "yellow", "red": "bold red"}
_KINDS = {"wrong_rig": "rig fits", "identifiability": "determined", "rig_value": "rig's value?",
          "missing_topic": "missing"}  # fmt: skip
_DOUBTED = {"wrong_rig": "wrong rig?", "identifiability": "undetermined"}
"""Names of kinds whose plain name would say the opposite of an amber or red light."""
SAID_ELSEWHERE = ("identifiability", "rig_value", "noise", "excitation", "rest")
"""Kinds that identify and diagnose speak of in their results anyway; not a command that never changes."""


def check_lines(findings: Findings, width: int = WIDTH) -> list[Text]:
    """Return the findings of a record, each in lines of at most `width` columns: light, kind, channel, value.

    The expected value and the remedy follow where a light is not green.
    """
    lines = []
    for f in _each_remedy_once(findings.findings):
        head = f"{f.light:<{_LIGHT}}{f'{kind(f)} ':<{_KIND}}{f'{_channel(f)} ':<{_CHANNEL}}"
        said = f"{number(f)} {f.detail}" if f.unit == "1" else ", ".join(filter(None, (number(f), f.detail)))
        if f.light != "green":
            said = "; ".join(filter(None, (said, f.expected and f"expected {f.expected}", f.remedy)))
        text = wrap(f"{head}{said}", width, min(len(head), _LIGHT + _KIND + _CHANNEL))
        lines.append(Text.assemble((text[:_LIGHT], _STYLES[f.light]), text[_LIGHT:]))
    return lines


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
    subject = " ".join(filter(None, (f"{f.light}:", kind(f), _channel(f))))
    text = " ".join(filter(None, (number(f), f.detail))) or "none"
    parts = (f"{subject}: {text}", f"expected {f.expected}" if f.expected else "", f.remedy)
    return "; ".join(filter(None, parts))


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
        "schema": SCHEMA,
        **pick(first, "rig=rig_name"),
        "rig_option": first.rig_choice.option or None,
        "rig_is_default": first.rig_choice.is_default,
        "light": worst([c.light for c in checks]),
        "records": [
            {**pick(c, "bag=source light"), "findings": [_finding(f) for f in c.findings],
             "faults": [fault_json(f) for f in c.faults], "pairs": [_pair(p) for p in c.pairs]}
            for c in checks
        ],
    }  # fmt: skip


def _finding(f: Finding) -> dict[str, Any]:
    interval = None if f.low is None or f.high is None else strict([f.low, f.high])
    return {**pick(f, "light kind channel value unit"), "ci95": interval, **pick(f, "expected detail remedy")}


def _pair(p: Pair) -> dict[str, Any]:
    """Return a pair by the names of the contract: factor of y on x, lag of y behind x, s; from, to in s."""
    return {"channels": [p.law.y, p.law.x], **pick(p, "factor sign lag coherence from=start to=stop")}
