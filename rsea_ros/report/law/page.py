"""The page of a law: the missing torque over its variable, the law, and the other candidates."""

from __future__ import annotations

from dataclasses import replace

from rsea_ros.laws.law import LawResult, WrittenLaw, about_of, equation_of
from rsea_ros.report import words
from rsea_ros.report.file_names import BASE
from rsea_ros.report.law.figures import over_figure, time_figure
from rsea_ros.report.law.tables import dependence_section, gain_section, tried_section
from rsea_ros.report.law.words import headline, parameter_lines
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, code, equation, key_numbers, section
from rsea_ros.report.provenance import Provenance
from rsea_ros.report.rig.words import command


def law_report(result: LawResult, provenance: Provenance | None = None) -> str:
    """Return the page as HTML that opens without a network."""
    blocks: list[Block] = [key_numbers(_keys(result))]
    for written in result.laws:
        blocks += [_equation(written), over_figure(written), time_figure(written)]
    blocks += [dependence_section(result), gain_section(result), tried_section(result), _files(result)]
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


def _files(result: LawResult) -> str:
    if not result.laws:
        return ""
    names = [f"{w.law.name}.py" for w in result.laws]
    again = command("diagnose", ["RUN.mcap"], "", replace(result.rig_choice, part=()), BASE)
    use = f"RSEA_EFFECTS=. {again} --out again"
    text = (
        f"<p>{', '.join(code(n) for n in names)}: the law as an effect, to read and to change. "
        f"{code('model.yaml')}: the rig with it, {code('base.yaml')}: the rig without.</p>"
        f'<p class="next">On a fresh record, in the folder of these files: {code(use)}</p>'
    )
    return section("How to use it", text)
