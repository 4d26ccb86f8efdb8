"""The causes of a diagnosis as HTML: named causes with their evidence, and rejected effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from rsea_ros.diagnosis.result import Cause, CauseParameter, Diagnosis, Rejected
from rsea_ros.documents.wording import list_names
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.sentences import evidence
from rsea_ros.report.diagnosis.status_line import STATUS, status_line
from rsea_ros.report.figures.palette import AFTER, GRID, MEASURED, QUIET, faint
from rsea_ros.report.page.html import bullets, equation, paragraph, section
from rsea_ros.report.page.html_table import table_of_rows

_WIDTH, _HEIGHT = 180.0, 18.0
_GAIN = "Gain: share of the residual that the cause removes, on held-out data."


def cause_section(cause: Cause, diagnosis: Diagnosis) -> str:
    """Return a cause with its size, its certainty, and the evidence for it."""
    share = f"{num.percent(cause.gain_holdout)} of the {words.channel(cause.channel)} residual"
    how_sure = status_line(cause, diagnosis.alternatives, diagnosis.at_noise_floor)
    body = [_sizes(cause), paragraph(words.sentence(f"{say.prose(how_sure)}."))]
    body += [equation(cause.equation) if cause.equation else "", paragraph(evidence(cause))]
    body += [paragraph(_gain(cause)), _rivals(cause)]
    return section(words.sentence(f"{words.effect(cause.name)}: {share}"), *body)


def _gain(cause: Cause) -> str:
    interval = num.percent_range(cause.gain_holdout_ci95)
    train = num.percent(cause.gain_train)
    return f"95 % interval of that gain: {interval}; on the training data it is {train}."


def _sizes(cause: Cause) -> str:
    cells = []
    for name, p in num.sizes(cause).items():
        value, doubt, unit = num.estimate(p)
        doubt = f" <small>{doubt.strip()}</small>" if doubt else ""
        label = f"{escape(name.replace('_', ' '))}, 95 % interval{escape(_model_share(p))}"
        cells.append(f"<div><b>{value}{doubt} {escape(unit)}</b><span>{label}</span></div>")
    return f'<div class="keys">{"".join(cells)}</div>'


def _model_share(estimate: CauseParameter) -> str:
    """Return how much of an interval the simulation itself adds, `, of which the simulation ± 0.0147 N·m`."""
    if not estimate.model_sd > 0.0:
        return ""
    half, unit = num.model_half_width(estimate)
    return f", of which the simulation ± {half} {unit}".rstrip()


def _rivals(cause: Cause) -> str:
    if not cause.confusable_with:
        return ""
    rivals = list_names([words.effect(n) for n in cause.confusable_with])
    return paragraph(f"These data do not distinguish it from {rivals}.")


def tried_section(diagnosis: Diagnosis) -> str:
    """Return all effects tried: causes and fitted rivals with their gains, then the others by reason."""
    if not (diagnosis.causes or diagnosis.rejected):
        return ""
    rows = [_row(c.name, c.gain_holdout, STATUS[c.status], strong=True) for c in diagnosis.causes]
    rows += [_row(r.name, r.gain_holdout, say.rejection(r)) for r in fitted_rivals(diagnosis)]
    shown = table_of_rows(("Cause", "#Gain", "", "Outcome"), rows) if rows else ""
    others = bullets(_by_reason([r for r in diagnosis.rejected if not r.is_fitted]))
    return section(_tried_title(diagnosis), shown, others, caption=_GAIN)


def fitted_rivals(diagnosis: Diagnosis) -> list[Rejected]:
    """Return the effects that were fitted to all training data and rejected, largest gain first."""
    fitted = (r for r in diagnosis.rejected if r.is_fitted)
    return sorted(fitted, key=lambda r: -r.gain_holdout if math.isfinite(r.gain_holdout) else math.inf)


def _tried_title(diagnosis: Diagnosis) -> str:
    tried = len(diagnosis.causes) + len(diagnosis.rejected)
    return f"{tried} causes were tried, {len(diagnosis.causes) or 'none'} accepted"


def _by_reason(rejected: Sequence[Rejected]) -> list[str]:
    names: dict[str, list[str]] = {}
    for r in rejected:
        names.setdefault(say.rejection(r), []).append(words.effect(r.name))
    return [f"{words.sentence(say.prose(why))}: {list_names(sorted(n))}." for why, n in names.items()]


def _row(name: str, gain: float, outcome: str, strong: bool = False) -> str:
    plain = escape(words.sentence(words.effect(name)))
    shown = f"<b>{plain}</b>" if strong else plain
    bar = _bar(gain, AFTER if strong else faint(MEASURED, 0.6))
    return (
        f"<tr><td>{shown}<small>{escape(name)}</small></td><td class='number'>{num.percent(gain)}</td>"
        f"<td>{bar}</td><td>{escape(say.prose(outcome))}</td></tr>"
    )


def _bar(share: float, colour: str) -> str:
    """Return a bar from zero to a share of one; one below zero is only a stroke at zero."""
    length = _WIDTH * min(max(share, 0.0), 1.0)
    return (
        f'<svg class="interval" viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" aria-hidden="true">'
        f'<rect x="0" y="3" width="{_WIDTH:g}" height="{_HEIGHT - 6:g}" rx="2" fill="{GRID}" opacity="0.5"/>'
        f'<rect x="0" y="3" width="{length:.1f}" height="{_HEIGHT - 6:g}" rx="2" fill="{colour}"/>'
        f'<line x1="0.5" x2="0.5" y1="0" y2="{_HEIGHT:g}" stroke="{QUIET}"/></svg>'
    )
