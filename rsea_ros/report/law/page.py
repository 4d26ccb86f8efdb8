"""The page of a law: the missing torque over what it depends on, the law in it, and what else was tried."""

from __future__ import annotations

from html import escape

import numpy as np

from rsea_ros.laws.equation import about_of, equation_of
from rsea_ros.laws.result import LawResult, WrittenLaw
from rsea_ros.report import words
from rsea_ros.report.figures.figure import Figure, Json, axis, band, label, layout, line, numbers
from rsea_ros.report.figures.palette import AFTER, BEFORE, INK, MEASURED, QUIET, faint
from rsea_ros.report.law.words import NAMES, UNITS, gain_sentence, headline, parameter_lines
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, code, equation, folded, key_numbers, paragraph, section
from rsea_ros.report.page.table import table_of_rows
from rsea_ros.report.provenance import Provenance
from rsea_ros.signals import UNITS as CHANNEL_UNITS
from rsea_ros.signals import FloatArray

_WINDOWS = 12
_CURVE = 160
_MOST_TRIED = 12
_DEPENDENCE_HEADS = ("A function of", "#", "#explains, held out", "#of what the law leaves")


def law_report(result: LawResult, provenance: Provenance | None = None) -> str:
    """Return the page as HTML that opens without a network."""
    blocks: list[Block] = [key_numbers(_keys(result))]
    for written in result.laws:
        blocks += [_equation(written), _over(written), _in_time(written)]
    blocks += [_depends(result), _levels(result), _tried(result), _files(result)]
    footer = provenance.lines if provenance else ()
    return page(headline(result), f"A law for what {result.rig_name} leaves unexplained", blocks, footer)


def _keys(result: LawResult) -> list[tuple[str, str]]:
    keys = [(f"{result.duration:.0f} s", "of data")]
    if not result.laws:
        return keys
    low, high = (100.0 * v for v in result.gain_ci95)
    return [
        (f"{100 * result.gain:.0f} %", f"less residual, held out (95 %: {low:.0f} to {high:.0f} %)"),
        (f"{min(100 * result.share, 100):.0f} %", "of the power above the noise explained"),
        (str(sum(len(w.law.parts) for w in result.laws) or "curve"), "terms"),
        *keys,
    ]


def _equation(written: WrittenLaw) -> str:
    law = written.law
    claims = written.claims
    facts = [
        f"Shows most in the {words.channel(claims.channel)}; "
        + {"odd": "turns with the command's sign", "even": "keeps its sign when the command turns",
           "neither": "neither odd nor even"}[claims.parity]
        + ("; can only take energy" if claims.passive else "")
        + ".",
    ]  # fmt: skip
    if law.is_learnt:
        facts.append("A learnt law is a curve through the data. It improves predictions and names no cause.")
    return section(
        about_of(law).capitalize(), equation(equation_of(law)), bullets([*parameter_lines(law), *facts])
    )


def _over(written: WrittenLaw) -> Figure:
    shown, law = written.shown, written.law
    x, y, unit = _folded(written), shown.values, "rad" if law.place == "encoder" else "N m"
    centre, low, high = _curve(x, shown.law)
    middle, error = _binned(x, y, centre)
    windows = np.array_split(np.argsort(shown.t), _WINDOWS)
    data: list[Json] = [
        _points(x, y, faint(MEASURED, 0.28), 3.5, "measured"),
        *(_points(x[k], y[k], faint(BEFORE, 0.85), 5, "", visible=i == 0)
          for i, k in enumerate(windows)),
        band(centre, low, high, faint(AFTER, 0.16)),
        _bars(centre, middle, error),
        line(centre, 0.5 * (low + high), "law", AFTER, 2.6),
    ]  # fmt: skip
    steps = [
        {"label": f"{shown.t[k[0]]:.0f}", "method": "restyle",
         "args": ["visible", [True, *(j == i for j in range(_WINDOWS)), True, True, True]]}
        for i, k in enumerate(windows)
    ]  # fmt: skip
    small = {"size": 12, "color": QUIET}
    value = {"prefix": "orange: from ", "suffix": " s on", "font": small}
    slider = {"active": 0, "currentvalue": value, "steps": steps, "pad": {"t": 44}, "len": 1.0, "x": 0.0,
              "tickcolor": QUIET, "font": small}  # fmt: skip
    top = float(np.quantile(np.abs(y), 0.995))
    what = "angle" if unit == "rad" else "torque"
    wave = "one period of the " if _cycles(written) else ""
    return Figure(
        f"The missing {what} over the {NAMES[shown.over]}, and the law in it",
        f"Grey: what the simulation lacks, point by point (one sigma {shown.sd:.2g} {words.unit(unit)}). "
        "Black: its mean with 95 %. Blue: the law; its band is the spread by what else the law reads. The "
        "slider shows one stretch of time in orange.",
        data,
        layout(
            xaxis=axis(f"{wave}{NAMES[shown.over]}, {words.unit(UNITS[shown.over])}"),
            yaxis=axis(f"missing, {words.unit(unit)}", range=[-1.15 * top, 1.15 * top]),
            hovermode="closest", sliders=[slider], margin={"l": 64, "r": 24, "t": 12, "b": 96},
        ),
        560,
    )  # fmt: skip


def _points(
    x: FloatArray, y: FloatArray, colour: str, size: float, name: str, *, visible: bool = True
) -> Json:
    return {"type": "scattergl", "mode": "markers", "x": numbers(x), "y": numbers(y), "name": name,
            "marker": {"size": size, "color": colour}, "visible": visible, "hoverinfo": "skip"}  # fmt: skip


def _bars(x: FloatArray, y: FloatArray, error: FloatArray) -> Json:
    keep = np.isfinite(y)
    return {"type": "scatter", "mode": "markers", "x": numbers(x[keep][::6]), "y": numbers(y[keep][::6]),
            "error_y": {"type": "data", "array": numbers(error[keep][::6]), "thickness": 1.2, "width": 0,
                        "color": INK},
            "marker": {"size": 6, "color": INK}, "name": "mean"}  # fmt: skip


def _cycles(written: WrittenLaw) -> float:
    cycles = [p.shape for p in written.law.parts if p.term.shape == "cycles_per_revolution"]
    return cycles[0] if cycles and written.shown.over == "theta" else 0.0


def _folded(written: WrittenLaw) -> FloatArray:
    """Return what the law is drawn over; a wave's angle within one period."""
    cycles, x = _cycles(written), written.shown.x
    return np.mod(x, 2.0 * np.pi / cycles) if cycles else x


def _curve(x: FloatArray, law: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places along x, and the 10 to 90 % of the law there, which spread by what else it reads."""
    first, last = (float(v) for v in np.quantile(x, [0.002, 0.998]))
    edges = np.linspace(first, last, _CURVE + 1)
    which = np.clip(np.searchsorted(edges, x) - 1, 0, _CURVE - 1)
    centre = 0.5 * (edges[1:] + edges[:-1])
    low, high = np.full(_CURVE, np.nan), np.full(_CURVE, np.nan)
    for k in range(_CURVE):
        inside = law[which == k]
        if len(inside):
            low[k], high[k] = np.quantile(inside, [0.1, 0.9])
    keep = np.isfinite(low)
    return centre[keep], low[keep], high[keep]


def _binned(x: FloatArray, y: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of y near each centre with its 95 % half-width, nan where few points are."""
    edges = np.concatenate([[-np.inf], 0.5 * (centre[1:] + centre[:-1]), [np.inf]])
    which = np.searchsorted(edges, x) - 1
    count = np.bincount(which, minlength=len(centre))[: len(centre)]
    mean = np.bincount(which, y, len(centre))[: len(centre)] / np.maximum(count, 1)
    square = np.bincount(which, y * y, len(centre))[: len(centre)] / np.maximum(count, 1)
    error = 1.96 * np.sqrt(np.maximum(square - mean**2, 0.0) / np.maximum(count, 1))
    return np.where(count > 4, mean, np.nan), error


def _in_time(written: WrittenLaw) -> Figure:
    shown, unit = written.shown, "rad" if written.law.place == "encoder" else "N m"
    data = [
        line(shown.t, shown.values, "missing", MEASURED, 1.0),
        line(shown.t, shown.law, "law", AFTER, 1.4),
    ]
    ends = [label("missing", 1.0, 0.85, MEASURED, xref="paper", yref="paper", xshift=6),
            label("law", 1.0, 0.72, AFTER, xref="paper", yref="paper", xshift=6)]  # fmt: skip
    middle = float(shown.t[len(shown.t) // 2])
    return Figure(
        "The same over time", "Drag to look closer, double click to see all.", data,
        layout(xaxis=axis("time, s", range=[middle, min(middle + 3.0, float(shown.t[-1]))]),
               yaxis=axis(words.unit(unit)), annotations=ends),
        300,
    )  # fmt: skip


def _depends(result: LawResult) -> str:
    if not result.dependences:
        return ""
    top = [d for d in result.dependences if d.share > 0.005][:10]
    rows = [
        f"<tr><td>{escape(d.regressor)}<small>{escape(d.place)}</small></td>"
        f"<td data-label='alone'>{bars_of(d.share)}</td>"
        f"<td class='number' data-label='alone'>{100 * min(d.share, 1.0):.0f} ± {196 * d.se:.0f} %</td>"
        f"<td class='number' data-label='of what the law leaves'>{100 * max(d.beside, 0.0):.1f} %</td></tr>"
        for d in top
    ]
    return section(
        "What it depends on", table_of_rows(_DEPENDENCE_HEADS, rows),
        caption="Laws without a form, a spline or a memory each, fitted to some blocks of time and judged on "
        "others: share of the power above the noise that they take.",
    )  # fmt: skip


def bars_of(share: float) -> str:
    """Return a share as a small bar."""
    width = 160.0 * min(max(share, 0.0), 1.0)
    return (
        f'<svg viewBox="0 0 160 14" width="160" height="14" role="img" aria-label="{100 * share:.0f} %">'
        f'<rect x="0" y="3" width="160" height="8" rx="2" fill="{faint(QUIET, 0.15)}"/>'
        f'<rect x="0" y="3" width="{width:.1f}" height="8" rx="2" fill="{AFTER}"/></svg>'
    )


def _levels(result: LawResult) -> str:
    rows = [
        f"<tr><td>{escape(words.channel(n))}</td>"
        + "".join(
            f"<td class='number' data-label='{what}'>{words.quantity(rms, CHANNEL_UNITS[n], 3)}</td>"
            for what, rms in (
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
        "What is gained",
        table_of_rows(("Channel", "#without", "#with the law", "#noise"), rows),
        caption=text,
    )


def _tried(result: LawResult) -> str:
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
    return folded("What else was tried", note, table_of_rows(("Terms", "#left, held out"), rows))


def _files(result: LawResult) -> str:
    if not result.laws:
        return ""
    names = [f"{w.law.name}.py" for w in result.laws]
    use = "RSEA_EFFECTS=. rsea diagnose RUN.mcap --rig base.yaml --out again"
    text = (
        f"<p>{', '.join(code(n) for n in names)}: the law as an effect, to read and to change. "
        f"{code('model.yaml')}: the rig with it, {code('base.yaml')}: the rig without.</p>"
        f'<p class="next">On a fresh record, in the folder of these files: {code(use)}</p>'
    )
    return section("How to use it", text)
