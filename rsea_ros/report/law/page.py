"""The page of a law beside its files: the missing torque, the law, the other candidates."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rsea_ros.effects.catalogue import lend
from rsea_ros.laws.law import LawResult, WrittenLaw, about_of, equation_of
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.records.record import UNITS
from rsea_ros.records.statistics import Z95
from rsea_ros.report import page as html, words
from rsea_ros.report.figures.figure import AFTER, QUIET, faint
from rsea_ros.report.law.figures import over_figure, time_figure
from rsea_ros.report.law.words import gain_sentence, headline, law_json, parameter_lines
from rsea_ros.report.result_files import BASE, LAW_JSON, MODEL, REPORT, Provenance, json_text
from rsea_ros.report.rig import command

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
        return new.write(REPORT, law_report(result, provenance))


def law_report(result: LawResult, provenance: Provenance | None = None) -> str:
    """Return the page as HTML that opens without a network."""
    kicker = f"A law for what {result.rig_name} leaves unexplained"
    return html.page(headline(result), kicker, _blocks(result), (), provenance)


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
        yield time_figure(written)
    if result.dependences:
        yield _dependences(result)
    yield _gain(result)
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
    shown = html.listed(
        [d for d in result.dependences if d.share > 0.005][:10],
        ("A function of", lambda d: html.named(d.regressor, d.place)),
        ("#", lambda d: html.bar(d.share, AFTER, faint(QUIET, 0.15), 160.0)),
        ("#explains, held out", lambda d: f"{100 * min(d.share, 1.0):.0f} ± {100 * Z95 * d.se:.0f} %"),
        ("#of the rest", lambda d: f"{100 * max(d.beside, 0.0):.1f} %"),
    )
    return html.section(
        "Dependence of the residual", shown,
        caption="Laws without a form, a spline or a memory each, fitted to some blocks of time and judged on "
        "others: share of the power above the noise that they take.",
    )  # fmt: skip


def _gain(result: LawResult) -> html.Html:
    plain = "Residual, RMS, on blocks of time that took part in no fit."
    shown = html.listed(
        result.before,
        ("Channel", words.channel),
        ("#without", lambda n: words.quantity(result.before[n], UNITS[n], 3)),
        ("#with the law", lambda n: words.quantity(result.after[n], UNITS[n], 3)),
        ("#noise", lambda n: words.quantity(result.noise[n], UNITS[n], 3)),
    )
    return html.section("Gain", shown, caption=gain_sentence(result) if result.laws else plain)


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
