"""Tables of a law: dependences of the missing torque, gains, other models."""

from __future__ import annotations

from html import escape

from rsea_ros.laws.law import LawResult
from rsea_ros.records.record import UNITS as CHANNEL_UNITS
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures.palette import AFTER, QUIET, faint
from rsea_ros.report.law.words import gain_sentence
from rsea_ros.report.page.html import fold, paragraph, section
from rsea_ros.report.page.html_table import table_of_rows

_MOST_TRIED = 12
_DEPENDENCE_HEADS = ("A function of", "#", "#explains, held out", "#of the rest")


def dependence_section(result: LawResult) -> str:
    """Return the dependences of the missing torque, with their explained shares."""
    if not result.dependences:
        return ""
    top = [d for d in result.dependences if d.share > 0.005][:10]
    rows = [
        f"<tr><td>{escape(d.regressor)}<small>{escape(d.place)}</small></td>"
        f"<td data-label='alone'>{_share_bar(d.share)}</td>"
        f"<td class='number' data-label='alone'>{100 * min(d.share, 1.0):.0f} ± {100 * Z95 * d.se:.0f} %</td>"
        f"<td class='number' data-label='of what the law leaves'>{100 * max(d.beside, 0.0):.1f} %</td></tr>"
        for d in top
    ]
    return section(
        "Dependence of the residual", table_of_rows(_DEPENDENCE_HEADS, rows),
        caption="Laws without a form, a spline or a memory each, fitted to some blocks of time and judged on "
        "others: share of the power above the noise that they take.",
    )  # fmt: skip


def gain_section(result: LawResult) -> str:
    """Return the residual of each channel without and with the law."""
    rows = [
        f"<tr><td>{escape(words.channel(n))}</td>"
        + "".join(
            f"<td class='number' data-label='{case}'>{words.quantity(rms, CHANNEL_UNITS[n], 3)}</td>"
            for case, rms in (
                ("without", result.before[n]), ("with the law", result.after[n]), ("noise", result.noise[n])
            )
        )
        + "</tr>"
        for n in result.before
    ]
    text = (
        gain_sentence(result) if result.laws else "Residual, RMS, on blocks of time that took part in no fit."
    )
    return section(
        "Gain",
        table_of_rows(("Channel", "#without", "#with the law", "#noise"), rows),
        caption=text,
    )


def tried_section(result: LawResult) -> str:
    """Return the laws that were tried, the best first."""
    if not result.tried:
        return ""
    ordered = sorted(result.tried, key=lambda t: t.left)[:_MOST_TRIED]
    ordered += [t for t in result.tried if t.chosen and t not in ordered]
    rows = [
        f"<tr><td>{'<b>' if t.chosen else ''}{escape(', '.join(t.terms))}{'</b>' if t.chosen else ''}"
        f"<small>{escape(t.place)}</small></td>"
        f"<td class='number' data-label='left'>{100 * t.left:.1f} %</td></tr>"
        for t in ordered
    ]
    note = paragraph(
        "The shortest law within one standard error of the best is taken (bold); its terms are then fitted "
        "in the simulation, and those that it does not need fall away."
    )
    return fold("Other candidates", note, table_of_rows(("Terms", "#left, held out"), rows))


def _share_bar(share: float) -> str:
    """Return a share as a small bar."""
    width = 160.0 * min(max(share, 0.0), 1.0)
    return (
        f'<svg viewBox="0 0 160 14" width="160" height="14" role="img" aria-label="{100 * share:.0f} %">'
        f'<rect x="0" y="3" width="160" height="8" rx="2" fill="{faint(QUIET, 0.15)}"/>'
        f'<rect x="0" y="3" width="{width:.1f}" height="8" rx="2" fill="{AFTER}"/></svg>'
    )
