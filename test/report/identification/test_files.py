"""Result files and the terminal's table."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from rsea_ros.identification.result import Identification
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report import words
from rsea_ros.report.identification import page as results
from rsea_ros.report.identification.words import identification_json, terminal_table


def test_all_files_are_written_and_none_is_partial(identification: Identification, tmp_path: Path) -> None:
    report = results.write_results(identification, tmp_path / "new" / "out")
    assert report.name == "report.html"
    assert {p.name for p in report.parent.iterdir()} == {"identification.json", "model.yaml", "report.html"}
    assert load_rig(report.parent / "model.yaml").values() == identification.rig.values()
    written = json.loads((report.parent / "identification.json").read_text(encoding="utf-8"))
    assert written == identification_json(identification)


def test_json_holds_no_infinity_and_all_that_others_rely_on(identification: Identification) -> None:
    document = identification_json(identification)
    text = json.dumps(document, allow_nan=False)
    assert json.loads(text)["parameters"]["spring.damping"]["ci95"] == [None, None]
    inertia = document["parameters"]["rotor.reflected_inertia"]
    assert (inertia["value"], inertia["unit"]) == (0.95312, "kg m^2")
    assert document["correlation"]["matrix"][1][2] is None
    assert {"residual_rms", "noise_rms", "fit_percent", "statements", "data"} <= set(document)


def test_a_write_that_fails_leaves_nothing(identification: Identification, tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OSError, match=r"report\.html"):
        results.write_results(identification, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_terminal_table_sets_truth_beside(identification: Identification) -> None:
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(terminal_table(identification, {"rotor.reflected_inertia": 0.9535}))
    text = console.export_text()
    assert "0.95312 ± 0.00011" in text
    assert "kg·m²" in text
    assert " no" in text
    assert "clock.ft" not in text


def test_reports_do_not_import_the_plotting_library(tmp_path: Path) -> None:
    code = "import sys, rsea_ros.report.identification.page; sys.exit('plotly' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_empty_identification_still_makes_a_page(identification: Identification, tmp_path: Path) -> None:
    bare = replace(identification, responses=(), models=(), overlays=(), remarks=(), parameters=())
    assert results.write_results(bare, tmp_path).exists()


@pytest.mark.parametrize(
    ("value", "low", "high", "text"),
    [(0.95312, 0.95301, 0.95323, ("0.95312", "0.00011")), (1530.4, 1500.4, 1560.4, ("1530", "30")),
     (-2.0, -2.5, -1.5, ("−2.00", "0.50")), (1.0, 1.0, 1.0, ("1.000", ""))],
)  # fmt: skip
def test_values_are_rounded_to_their_interval(
    value: float, low: float, high: float, text: tuple[str, str]
) -> None:
    assert words.with_interval(value, low, high) == text


def test_small_quantities_get_a_prefix() -> None:
    assert words.quantity(6.17e-6, "rad") == "6.17 µrad"
    assert words.quantity(0.03, "N m") == "0.0300 N·m"
    assert words.number(float("inf")) == "∞"
