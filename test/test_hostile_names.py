"""What comes from outside stays text in what is generated: programs, models, pages, tables, shell lines."""

import ast
import shlex
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

from rsea_ros.effects.effect import Claims
from rsea_ros.exports.mjcf import export_mjcf
from rsea_ros.exports.others import Export
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.law import FittedTerm, Law
from rsea_ros.laws.terms import GEAR_TERMS
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice, load_rig, rig_text
from rsea_ros.report.figures.figure import Figure
from rsea_ros.report.page import Html, code, page
from rsea_ros.report.remark_words import command

RIG = load_rig("paper_high_impedance")
CODE = "__import__('os').system('touch pwned')"
PIECES = (
    f'"""+{CODE}+"""', f"'''+{CODE}+'''", f'"+{CODE}+"', f"'+{CODE}+'", f"\n{CODE}\n", f"\r{CODE}",
    f"{{{CODE}}}", f"\\\"\"\"\n{CODE}", "\\", '"', "'", '"""', "'''", '\\"""', "\\N{BULLET}", "\\x",
    "\\u12", "%s%n", "{0.__class__}", "$(touch pwned)", "`touch pwned`", "; touch pwned", "| touch pwned",
    "&& touch pwned", "> pwned", "a\nb", "*", "~", "#x", "--force", "-rf", "!!", "a b", "$HOME",
    "<script>alert(1)</script>", "</script><script>alert(1)", "<!--<script>", "--><b>", "<b onload=x>",
    "&lt;b&gt;", "]]>", "<![CDATA[", "<?xml?>", "---", "--", "- -", "a: b", "- a", "&a", "*a",
    "!!python/object:os.system", "? a", "%TAG", "null", "1e3", "=1+cmd|' /C calc'!A0", "+1", "@SUM(1)",
    "\t=1", "\x00", "\x1b[31m", "\u202ereversed", "\u2028", "\x85", "\ud800", "\ufffe", "Größe µ·²",
    "a" * 5000, "",
)  # fmt: skip


def law_file(name: str) -> str:
    term = next(t for t in GEAR_TERMS if t.name == "quadratic_drag")
    law = Law("law", term.place, term.regressor, (FittedTerm(term, 1.0, 0.0),), {"w": 1.0})
    where = LawProvenance("2026-01-01", "0.0", {name: "ab12"}, "Gain: 50 %.")
    return source_of(law, Claims("velocity", "neither", None), where)


def same_program(generated: Callable[[str], str]) -> None:
    """Assert that a Python file has the same program whatever a name is."""

    def program(name: str) -> str:
        tree = ast.parse(generated(name))
        assert isinstance(tree.body[0], ast.Expr)
        return ast.dump(ast.Module(tree.body[1:], []))

    expected = program("run.mcap")
    for piece in PIECES:
        assert program(piece) == expected, piece


def test_a_law_has_the_same_program_whatever_a_name_is():
    """A bag whose name closes the docstring ran a command when the law was loaded as its page says."""
    same_program(law_file)


def same_elements(export: Callable[[Rig], Export]) -> None:
    """Assert that a model in XML has the same elements whatever the name of its rig is."""

    def elements(name: str) -> list[str]:
        content = export(replace(RIG, name=name)).content
        root = ElementTree.fromstring(content.encode("utf-8"))
        return [f"{one.tag} {sorted(one.keys())}" for one in root.iter()]

    expected = elements("knee")
    for piece in PIECES:
        assert elements(piece) == expected, piece


def test_a_model_has_the_same_elements_whatever_a_name_is():
    same_elements(export_mjcf)


def test_a_rig_file_gives_its_name_back(tmp_path):
    from rsea_ros.errors import RigError

    for piece in PIECES:
        path = tmp_path / "rig.yaml"
        try:
            path.write_text(rig_text(replace(RIG, name=piece)), encoding="utf-8")
            assert load_rig(path).name == piece
        except (RigError, UnicodeEncodeError) as error:
            assert "\n" not in str(error) and not (piece and piece.isprintable()), piece


class Tags(HTMLParser):
    """Collects tags, and the scripts between them."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.found.append(f"{tag} {[name for name, _ in attrs]}")

    def handle_endtag(self, tag):
        self.found.append(f"/{tag}")


def test_a_page_has_the_same_tags_whatever_a_name_is():
    def tags(name: str) -> list[str]:
        figure = Figure(name, name, [{"type": "scatter", "name": name}], {"title": name})
        parser = Tags()
        parser.feed(page(name, name, [figure, Html(f"<p>{code(name)}</p>")], [name]))
        return parser.found

    expected = tags("knee")
    for piece in filter(None, PIECES):
        assert tags(piece) == expected, piece
    figure = Figure("", "", [{"name": "<!--<script>"}], {})
    assert "<!--" not in page("", "", [figure], []), "a browser would read on to the next but one </script>"


def test_a_shell_line_has_the_same_words_whatever_a_name_is():
    for piece in PIECES:
        line = command("diagnose", [piece], piece, RigChoice())
        assert shlex.split(line) == ["rsea", "diagnose", piece, "--rig", piece]
