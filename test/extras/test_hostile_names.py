"""What comes from outside stays text in exports and in tables of the fleet."""

from __future__ import annotations

import csv
import io
import zipfile
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from rsea_extras.cli.fleet import no_formula
from rsea_extras.exports.feedforward import export_feedforward
from rsea_extras.exports.fmu import export_fmu
from rsea_extras.exports.isaac import export_isaac
from rsea_extras.exports.urdf import export_sdf, export_urdf
from rsea_ros.exports.others import identifier
from test.test_hostile_names import PIECES, RIG, same_elements, same_program


def isaac_file(name: str) -> str:
    return str(export_isaac(replace(RIG, name=name)).content)


def feedforward_file(name: str, suffix: str = ".py") -> str:
    return str(export_feedforward(replace(RIG, name=name), suffix, [name]).content)


@pytest.mark.parametrize("generated", [isaac_file, feedforward_file])
def test_a_python_file_has_the_same_program_whatever_a_name_is(generated):
    same_program(generated)


def test_c_is_the_same_program_and_a_table_the_same_rows_whatever_a_name_is():
    """The first end of a comment in the header is ours; only the prefix of the functions is a name's."""

    def program(name: str) -> str:
        text = feedforward_file(name, ".h").partition("*/")[2]
        return text.replace(identifier(name).upper(), "X").replace(identifier(name), "X")

    def rows(name: str) -> list[str]:
        return [line for line in feedforward_file(name, ".csv").split("\n") if not line.startswith("# ")]

    expected = program("knee"), rows("knee")
    for piece in (*PIECES, "*/ int pwned; /*", "*??/\n/", "*\\\n/"):
        assert identifier(piece).isidentifier() and identifier(piece).isascii()
        assert (program(piece), rows(piece)) == expected, piece


@pytest.mark.parametrize("export", [export_urdf, export_sdf])
def test_a_model_has_the_same_elements_whatever_a_name_is(export):
    same_elements(export)


def test_an_fmu_has_its_own_files_only():
    """One archive for all: each takes half a second."""
    name = " ".join(PIECES[:60])
    with zipfile.ZipFile(io.BytesIO(export_fmu(replace(RIG, name=name)).content)) as archive:
        assert not [one for one in archive.namelist() if ".." in one or one.startswith("/")]
        model = ElementTree.fromstring(archive.read("modelDescription.xml"))
        assert str(model.get("modelName")).isidentifier()


def test_a_spreadsheet_runs_no_cell():
    for piece in PIECES:
        text = io.StringIO()
        csv.writer(text).writerow([no_formula(piece)])
        (row,) = csv.reader(io.StringIO(text.getvalue(), newline=""))
        assert row[0].removeprefix("'") == piece.removeprefix("'")
        assert not row[0].startswith(("=", "+", "-", "@", "\t", "\r"))
    assert no_formula(-1.5) == "-1.5"
