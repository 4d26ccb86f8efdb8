"""The settings of a diagnosis as HTML: every number that steered the verdict, with its meaning and reason."""

from __future__ import annotations

from html import escape

from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.identification.settings import Setting
from rsea_ros.report import words
from rsea_ros.report.page.html import fold, paragraph
from rsea_ros.report.page.html_table import table_of_rows

_DEFAULTS = {s.name: s.value for s in DEFAULT.numbers()}


def settings_section(settings: DiagnosisSettings) -> str:
    """Return the settings, folded; those that are not the default stand out."""
    rows = [_row(s) for s in settings.numbers()]
    limits = f"At most {settings.max_causes} causes."
    if settings.without:
        limits += f" Not tried: {', '.join(settings.without)}."
    shown = table_of_rows(("Setting", "#Value", "Meaning", "Why this value"), rows)
    return fold("Settings: the numbers that steer the verdict", paragraph(limits), shown)


def _row(s: Setting) -> str:
    value = escape(f"{value_text(s.value)} {words.unit(s.unit)}".strip())
    default = _DEFAULTS[s.name]
    shown = value if s.value == default else f"<b>{value}</b> (default {value_text(default)})"
    return (
        f"<tr><td><code>{escape(s.name)}</code></td><td class='number'>{shown}</td>"
        f"<td>{escape(s.meaning)}</td><td>{escape(s.reason)}</td></tr>"
    )


def value_text(value: float | tuple[float, ...]) -> str:
    """Return a setting's number, or its numbers, as text."""
    return ", ".join(f"{v:g}" for v in value) if isinstance(value, tuple) else f"{value:g}"
