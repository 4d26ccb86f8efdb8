"""Which parameters move together: the correlation of a fit as a table of shaded cells."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.figures.palette import AFTER, BEFORE, faint
from rsea_ros.report.page.html import fold, paragraph

STRONG = 0.9
"""Correlation from which two values are hardly distinguishable."""


def correlation_section(names: Sequence[str], matrix: FloatArray) -> str:
    """Return the section; empty for fewer than two parameters. matrix: (n, n), nan where not defined."""
    if len(names) < 2:
        return ""
    heads = "".join(f"<th class='number'>{i}</th>" for i in range(1, len(names) + 1))
    rows = "".join(
        f"<tr><td>{i + 1} {escape(words.parameter(name))}</td>"
        + "".join(_cell(float(matrix[i, k])) for k in range(len(names)))
        + "</tr>"
        for i, name in enumerate(names)
    )
    table = (
        f"<div class='scroll'><table class='matrix'><thead><tr><th></th>{heads}</tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )
    return fold("Correlation of the parameters", paragraph(finding(names, matrix)), table)


def finding(names: Sequence[str], matrix: FloatArray) -> str:
    """Return a sentence on the pair that is least distinguishable."""
    apart = np.abs(np.where(np.eye(len(names), dtype=bool), 0.0, np.nan_to_num(matrix)))
    i, k = (int(v) for v in np.unravel_index(int(np.argmax(apart)), apart.shape))
    pair = f"{words.parameter(names[i])} and {words.parameter(names[k])}"
    value = words.minus(f"{matrix[i, k]:.2f}")
    if apart[i, k] < STRONG:
        return f"No two are strongly correlated; the strongest pair is {pair} ({value})."
    return f"Strongly correlated: {pair} ({value}). An error in one is compensated by the other."


def _cell(value: float) -> str:
    """Return a cell, the more coloured the stronger the correlation."""
    if not np.isfinite(value):
        return "<td class='number'>–</td>"
    shade = faint(AFTER if value >= 0.0 else BEFORE, 0.6 * min(1.0, abs(value)))
    text = words.minus(f"{value:.2f}")
    return f"<td class='number' style='background:{shade}'>{text}</td>"
