"""A law that no effect covers: page, figures, sentences and law.json beside its files."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rsea_ros.effects.catalogue import lend
from rsea_ros.laws.law import Law, LawResult, WrittenLaw, about_of, equation_of
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.files import Destination, NewFiles
from rsea_ros.records.record import UNITS, FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import page as html, words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.figure import AFTER, QUIET, faint
from rsea_ros.report.figures.overlay import overlay_figure
from rsea_ros.report.remark_words import command
from rsea_ros.report.result_files import BASE, LAW_JSON, MODEL, REPORT, Provenance, json_text, pick

_MOST_TRIED = 12
_PARITY = {"odd": "turns with the command's sign", "even": "keeps its sign when the command turns",
           "neither": "neither odd nor even"}  # fmt: skip


def write_law(result: LawResult, out: Destination | str | Path, provenance: Provenance | None = None) -> Path:
    """Write law.json, the effect files, base.yaml, model.yaml and report.html; return the last's path."""
    with NewFiles(out) as new, lend(*(w.effect for w in result.laws)):
        new.write(LAW_JSON, json_text(law_json(result), provenance))
        for written in result.laws:
            new.write(f"{written.law.name}.py", written.source)
        new.write(BASE, rig_text(result.base_rig))
        new.write(MODEL, rig_text(result.rig))
        kicker = f"A law for what {result.rig_name} leaves unexplained"
        return new.write(REPORT, html.page(headline(result), kicker, _blocks(result), (), provenance))


def _blocks(result: LawResult) -> Iterator[html.Block]:
    data = (f"{result.duration:.0f} s", "of data")
    low, high = (100.0 * v for v in result.gain_ci95)
    found = [
        (f"{100 * result.gain:.0f} %", f"less residual, held out (95 %: {low:.0f} to {high:.0f} %)"),
        (f"{min(100 * result.share, 100):.0f} %", "of the power above the noise explained"),
        (str(sum(len(w.law.parts) for w in result.laws) or "curve"), "terms"),
    ]
    yield html.key_numbers([*(found if result.laws else []), data])
    for written in result.laws:
        yield _law(written)
        yield over_figure(written)
        s, curves = written.shown, [fig.Curve("law", AFTER, written.shown.law)]
        missing = ("missing angle", "rad") if written.law.place == "encoder" else ("missing torque", "N·m")
        yield overlay_figure("The same over time", *missing, s.t, s.values, curves)
    if result.dependences:
        yield _dependences(result)
    plain = "Residual, RMS, on blocks of time that took part in no fit."
    shown = html.listed(
        result.before,
        ("Channel", words.channel),
        ("#without", lambda n: words.quantity(result.before[n], UNITS[n], 3)),
        ("#with the law", lambda n: words.quantity(result.after[n], UNITS[n], 3)),
        ("#noise", lambda n: words.quantity(result.noise[n], UNITS[n], 3)),
    )
    yield html.section("Gain", shown, caption=gain_sentence(result) if result.laws else plain)
    if result.tried:
        yield _tried(result)
    if result.laws:
        yield _files(result)


def _law(written: WrittenLaw) -> html.Html:
    law, claims = written.law, written.claims
    passive = "; can only take energy" if claims.passive else ""
    facts = [f"Shows most in the {words.channel(claims.channel)}; {_PARITY[claims.parity]}{passive}."]
    if law.is_learnt:
        facts.append("A learnt law is a curve through the data. It improves predictions and names no cause.")
    lines = html.bullets([*parameter_lines(law), *facts])
    return html.section(about_of(law).capitalize(), html.equation(equation_of(law)), lines)


def _dependences(result: LawResult) -> html.Html:
    """Return the dependences of the missing torque, with their explained shares."""
    known = [d for d in result.dependences if d.share > 0.005 and Z95 * d.se < 1.0][:10]
    shown = html.listed(
        known,
        ("A function of", lambda d: html.named(d.regressor, d.place)),
        ("#", lambda d: html.bar(d.share, AFTER, faint(QUIET, 0.15), 160.0)),
        ("#explains, held out", lambda d: f"{100 * min(d.share, 1.0):.0f} ± {100 * Z95 * d.se:.0f} %"),
        ("#of the rest", lambda d: f"{100 * max(d.beside, 0.0):.1f} %"),
    )
    return html.section(
        "Dependence of the residual", shown if known else "Too near the noise to tell.",
        caption="Laws without a form, a spline or a memory each, fitted to some blocks of time and judged on "
        "others: share of the power above the noise that they take.",
    )  # fmt: skip


def _tried(result: LawResult) -> html.Html:
    ordered = sorted(result.tried, key=lambda t: t.left)[:_MOST_TRIED]
    ordered += [t for t in result.tried if t.chosen and t not in ordered]
    note = (
        "The shortest law within one standard error of the best is taken (bold); its terms are then fitted "
        "in the simulation, and those that it does not need fall away."
    )
    left = ("#left, held out", lambda t: f"{100 * t.left:.1f} %")
    return html.fold(
        "Other candidates", note,
        html.listed(ordered, ("Terms", lambda t: html.named(", ".join(t.terms), t.place, t.chosen)), left),
    )  # fmt: skip


def _files(result: LawResult) -> html.Html:
    names = ", ".join(html.code(f"{w.law.name}.py") for w in result.laws)
    again = command("diagnose", ["RUN.mcap"], "", replace(result.rig_choice, part=()), BASE)
    use = html.code(f"RSEA_EFFECTS=. {again} --out again")
    return html.section("How to use it", html.Html(
        f"<p>{names}: the law as an effect, to read and to change. {html.code('model.yaml')}: the rig with "
        f"it, {html.code('base.yaml')}: the rig without.</p>"
        f'<p class="next">On a fresh record, in the folder of these files: {use}</p>'
    ))  # fmt: skip


_CURVE, _FEWEST = 160, 5
"""Bins along the law's variable, and points of a bin that has a mean."""


def over_figure(written: WrittenLaw) -> fig.Figure:
    """Return the missing torque and the law over the law's variable; a wave's angle within one period."""
    shown, law, x, y = written.shown, written.law, written.shown.x, written.shown.values
    cycles = [p.shape for p in law.parts if p.term.shape == "cycles_per_revolution" and shown.over == "theta"]
    if cycles and cycles[0]:
        x = np.mod(x, 2.0 * np.pi / cycles[0])
    over, over_unit = _LETTERS[shown.over]
    quantity, unit = ("angle", "rad") if law.place == "encoder" else ("torque", words.unit("N m"))
    centre, low, high, middle, error = _in_bins(x, y, shown.law)
    mean = np.flatnonzero(np.isfinite(middle))[::6]
    shades, key = [[0.0, fig.NOISE], [1.0, fig.BEFORE]], {"title": {"text": "time, s"}, **fig.KEY}
    look: fig.Json = {"size": 3.5, "opacity": 0.5, "color": fig.numbers(shown.t), "colorscale": shades,
                      "colorbar": key}  # fmt: skip
    sides: fig.Json = {"type": "data", "array": fig.numbers(error[mean]), "thickness": 1.2, "width": 0,
                       "color": fig.INK}  # fmt: skip
    data: list[fig.Json] = [
        fig.points(x, y, "measured", fig.NOISE, 3.5, hoverinfo="skip", marker=look),
        fig.band(centre, low, high, fig.faint(fig.AFTER, 0.16)),
        fig.points(centre[mean], middle[mean], "mean", fig.INK, 6, error_y=sides),
        fig.line(centre, 0.5 * (low + high), "law", fig.AFTER, 2.6, hovertemplate=f"%{{y:.3g}} {unit}"),
    ]  # fmt: skip
    top = 1.15 * float(np.quantile(np.abs(y), 0.995))
    wave = "one period of the " if cycles and cycles[0] else ""
    return fig.Figure(
        f"The missing {quantity} over the {over}, and the law in it",
        f"Points: missing in the simulation (one sigma {shown.sd:.2g} {unit}), the later the more orange. "
        "Black: their mean with 95 %. Blue: the law; its band is the spread from its other variables.",
        data,
        fig.layout(
            xaxis=fig.axis(f"{wave}{over}, {words.unit(over_unit)}"),
            yaxis=fig.axis(f"missing, {unit}", range=[-top, top]),
            hovermode="closest",
        ),
        560,
    )  # fmt: skip


def _in_bins(x: FloatArray, y: FloatArray, law: FloatArray) -> FloatArray:
    """Return at places along x, shape (5, n): the place, the 10 and 90 % of the law by its other variables,
    the mean of y and its 95 % half-width, NaN where few points are.
    """
    first, last = np.quantile(x, [0.002, 0.998])
    edges = np.linspace(first, last, _CURVE + 1)
    which = np.clip(np.searchsorted(edges, x) - 1, 0, _CURVE - 1)
    rows = []
    for k in np.unique(which):
        values, few = y[which == k], np.sum(which == k) < _FEWEST
        mean = (np.nan, np.nan) if few else (values.mean(), Z95 * values.std() / np.sqrt(len(values)))
        rows.append((0.5 * (edges[k] + edges[k + 1]), *np.quantile(law[which == k], (0.1, 0.9)), *mean))
    return np.asarray(np.array(rows).T)


_CLEARLY = 0.1
"""Share of what the law leaves that another variable must explain to be reported."""
_LETTERS = {
    "w": ("speed", "rad/s"), "q": ("angle", "rad"), "theta": ("rotor's angle", "rad"),
    "d": ("deflection", "rad"), "T": ("load", "N m"), "u": ("command", "N m"), "t": ("time", "s"),
    "share": ("time", "s"), "h": ("load's angle", "rad"), "law": ("law's value", "N m"),
}  # fmt: skip
"""What a law may be drawn over, with its unit."""


def headline(result: LawResult) -> str:
    """Return the result in a sentence."""
    if result.at_floor:
        return "No law is needed: the model is at the noise floor"
    if not result.laws:
        ratios = {n: v / result.noise[n] for n, v in result.before.items() if result.noise.get(n)}
        worst = max(ratios, key=lambda n: ratios[n], default="")
        size = f" of {words.number(ratios[worst])} times the noise ({words.channel(worst)})" if ratios else ""
        return f"A residual{size} remains, but no law surely reduces it on held-out blocks"
    law = result.laws[0].law
    others = any(d.beside > max(_CLEARLY, 2.0 * d.beside_se) for d in result.dependences)
    also = "" if others else " only"
    if len(result.laws) > 1:
        also = f", and of {depends_on(result.laws[1].law, result)}"
    kind = "A learnt law, which names no cause: " if law.is_learnt else ""
    share = f"{min(100.0 * result.share, 100.0):.0f} %"
    of = "of the residual's power above the noise is a function of"
    return f"{kind}{share} {of} {depends_on(law, result)}{also}{kin(law)}"


def kin(law: Law) -> str:
    """Return which effect of the catalogue has the form of a law that rings; empty for others."""
    rings = [p.shape for p in law.parts if p.term.memory == "ring"]
    is_mode = rings and law.place in ("ft", "spring")
    effect = words.effect("structural_resonance" if is_mode else "current_loop_overshoot")
    return f": it rings at {words.number(rings[0], 2)} Hz, as {effect} does" if rings else ""


def depends_on(law: Law, result: LawResult) -> str:
    """Return the variables of a law, a wave with its period."""
    cycles = [p.shape for p in law.parts if p.term.shape == "cycles_per_revolution"]
    if not cycles:
        return law.regressor
    ratio = abs(result.rig["gear.ratio"])
    around = f"2π/{cycles[0] * ratio:.4g} of the output"
    rotor = "" if ratio == 1.0 else f" ({cycles[0]:.4g} a turn of the rotor)"
    return f"{law.regressor.split(', periodic')[0]}, period {around}{rotor}"


def gain_sentence(result: LawResult) -> str:
    """Return the gain on held-out blocks."""
    low, high = result.gain_ci95
    return (
        f"The residual falls by {100 * result.gain:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f} %) on "
        "blocks of time that took part in no fit and no choice."
    )


def law_lines(result: LawResult) -> Iterator[str]:
    """Return the equations and their numbers, a line each."""
    for written in result.laws:
        yield equation_of(written.law)
        yield from (f"  {text}" for text in parameter_lines(written.law))


def parameter_lines(law: Law) -> list[str]:
    """Return each parameter with its value, interval and unit."""
    return [
        f"{n} = {''.join(words.with_doubt(v, *(ci95 or (v, v))))} {words.unit(unit)}".rstrip()
        for n, (v, ci95, unit) in _parameters(law).items()
    ]


Size = tuple[float, tuple[float, float] | None, str]


def _parameters(law: Law) -> dict[str, Size]:
    """Return value, 95 % interval and unit of each parameter by name, a shape that terms share once."""
    sizes: dict[str, Size] = {}
    for part, (coefficient, shape) in zip(law.parts, law.names, strict=True):
        sizes[coefficient] = (part.coefficient, part.ci95, part.term.unit)
        if shape:
            sizes.setdefault(shape, (part.shape, part.shape_ci95, part.term.shape_unit))
    return sizes


def law_json(result: LawResult) -> dict[str, Any]:
    """Return the contents of law.json."""
    return {
        "schema": 1,
        "rig": result.rig_name,
        "sentence": headline(result),
        "data": pick(result, "bags=sources duration_s=duration"),
        "at_noise_floor": result.at_floor,
        "gain": pick(result, "holdout=gain holdout_ci95=gain_ci95 share_of_excess=share"),
        "residual_rms": pick(result, "before after"),
        "noise_rms": pick(result, "noise")["noise"],
        "laws": [_law_json(w.law) for w in result.laws],
        "depends_on": [
            pick(d, "what=regressor at=place share se of_what_the_law_leaves=beside")
            for d in result.dependences
        ],
        "tried": [pick(t, "at=place terms left chosen") for t in result.tried],
    }


def _law_json(law: Law) -> dict[str, Any]:
    sizes = {
        n: {"value": v, "unit": unit, "ci95": list(ci95 or ())}
        for n, (v, ci95, unit) in _parameters(law).items()
    }
    return {
        "name": law.name, "file": f"{law.name}.py",
        **pick(law, "at=place depends_on=regressor learnt=is_learnt"), "equation": equation_of(law),
        "parameters": sizes,
    }  # fmt: skip
