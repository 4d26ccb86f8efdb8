"""The settings of a diagnosis as HTML: every number that steered the verdict, with its meaning and reason."""

from __future__ import annotations

from html import escape

from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, Setting
from rsea_ros.report import words
from rsea_ros.report.diagnosis.noise_numbers import NOISE_NUMBERS
from rsea_ros.report.page.html import folded, paragraph
from rsea_ros.report.page.html_table import table_of_rows

_DEFAULTS = {s.name: s.value for s in (*DEFAULT.listed(), *NOISE_NUMBERS)}


def settings_section(settings: DiagnosisSettings) -> str:
    """Return the settings, folded; those that are not the default stand out."""
    rows = [_row(s) for s in (*settings.listed(), *NOISE_NUMBERS)]
    limits = f"At most {settings.max_causes} causes."
    if settings.without:
        limits += f" Not tried: {', '.join(settings.without)}."
    limits += " No setting moves the numbers of the noise, which stand last."
    shown = table_of_rows(("Setting", "#Value", "Meaning", "Why this value"), rows)
    return folded("Settings: the numbers that steer the verdict", paragraph(limits), shown)


def _row(s: Setting) -> str:
    value = escape(f"{s.value:g} {words.unit(s.unit)}".strip())
    shown = value if s.value == _DEFAULTS[s.name] else f"<b>{value}</b> (default {_DEFAULTS[s.name]:g})"
    return (
        f"<tr><td><code>{escape(s.name)}</code></td><td class='number'>{shown}</td>"
        f"<td>{escape(s.meaning)}</td><td>{escape(s.reason)}</td></tr>"
    )
