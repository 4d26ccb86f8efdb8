"""`rsea paper` end to end: page, JSON, bags, and which model of the moving output holds on data held out."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from msg_adapters import read_record
from rsea_ros.cli.main import main
from rsea_ros.cli.paper import MOVING


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Return where one run of the verb has written, and what it has printed; tests of 20 s."""
    out, printed = tmp_path_factory.mktemp("paper"), StringIO()
    with redirect_stdout(printed):
        assert main(["paper", "--duration", "20", "--json", "--out", str(out)]) == 0
    return out, json.loads(printed.getvalue())


def test_paper_writes_page_json_and_bags(played):
    folder, result = played
    assert result["moving_output"]["paper_moving_output"]["lumped"][0]["explained"] < 0.5
    assert result["bands"]["Test platform"]["eq_7_hz"] == pytest.approx(53.20, abs=5e-3)
    assert json.loads((folder / "paper.json").read_text(encoding="utf-8")) == result
    page = (folder / "report.html").read_text(encoding="utf-8")
    for said in ("Fig. 9 (a)", "Fig. 15", "Fig. 18", "Fig. 20", "Table 1", "Table 2", "1638.783", "<svg"):
        assert said in page
    record = read_record([folder / "two_moving_outputs_housing_end.mcap"])
    assert len(record["ft"]) == 20 * 280


@pytest.mark.parametrize("rig", MOVING)
def test_unlumped_explains_the_held_out_torque_at_every_sensor(played, rig):
    held_out = played[1]["moving_output"][rig]["unlumped"]
    assert held_out and all(j["explained"] > 0.95 for j in held_out)


@pytest.mark.parametrize("rig", MOVING)
def test_lumped_fails_at_one_sensor_at_least(played, rig):
    assert min(j["explained"] for j in played[1]["moving_output"][rig]["lumped"]) < 0.5


def test_a_duration_that_is_too_short_is_refused(tmp_path, capsys):
    assert main(["paper", "--duration", "2", "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err == "rsea paper: --duration 2 s, expected at least 20 s\n"
    assert not (tmp_path / "x").exists()
