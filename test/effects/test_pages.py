"""The pages of effects in a notebook are well-formed HTML with all that the catalogue knows."""

from xml.etree import ElementTree

import pytest

from rsea_ros import effects
from rsea_ros.documents.units import plain
from rsea_ros.effects.catalogue import catalogue


def rows(html):
    return [["".join(cell.itertext()) for cell in row] for row in ElementTree.fromstring(html).iter("tr")]


def test_the_catalogue_lists_name_meaning_and_equation():
    head, *lines = rows(effects._repr_html_())
    assert head == ["effect", "what it is", "equation"]
    known = {name: effects[name] for name in catalogue()}
    assert lines == [[name, page.about, page.equation] for name, page in known.items()]
    text = repr(effects).splitlines()
    assert [line.split("  ")[0].strip() for line in text] == list(known)
    assert len({line.index(page.about) for line, page in zip(text, known.values(), strict=True)}) == 1


@pytest.mark.parametrize("name", ["coulomb_friction", "backlash", "torque_ripple", "command_delay"])
def test_a_page_has_a_row_for_each_parameter(name):
    page = effects[name]
    html = page._repr_html_()
    head, *lines = rows(f"<div>{html}</div>")
    assert head == ["parameter", "unit", "typical", "vanishes at", "bounds", "grows with", "why"]
    for line, p in zip(lines, page.effect.parameters, strict=True):
        bounds = f"{p.low:g} to {p.high:g}"
        numbers = [f"{p.typical:g}", f"{p.null:g}", bounds, page.grows_with(p)]
        assert line == [p.name, plain(p.unit) or "1", *numbers, p.reason]
    tree = ElementTree.fromstring(f"<div>{html}</div>")
    assert (tree.findtext("h4"), tree.findtext("p/code"), tree.findtext("pre")) == (
        name, page.equation, page.description
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "parameter", "grows"),
    [("coulomb_friction", "torque", "torque"), ("quadratic_drag", "coefficient", "torque / speed^2"),
     ("command_delay", "delay", ""), ("torque_ripple", "phase", "")],
)  # fmt: skip
def test_bounds_grow_with_the_machine(name, parameter, grows):
    page = effects[name]
    (which,) = (p for p in page.effect.parameters if p.name == parameter)
    assert page.grows_with(which) == grows
