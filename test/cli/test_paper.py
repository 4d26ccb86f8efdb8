"""`rsea paper` end to end: page, JSON and bags."""

from __future__ import annotations

import json

import pytest

from msg_adapters import read_record
from rsea_ros.cli.main import main


def test_paper_writes_page_json_and_bags(tmp_path, capsys):
    assert main(["paper", "--duration", "20", "--json", "--out", str(tmp_path)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["moving_output"]["paper_moving_output"]["unlumped"][0]["explained"] > 0.95
    assert result["moving_output"]["paper_moving_output"]["lumped"][0]["explained"] < 0.5
    assert result["bands"]["Test platform"]["eq_7_hz"] == pytest.approx(53.20, abs=5e-3)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    for said in ("Fig. 9 (a)", "Fig. 15", "Fig. 18", "Fig. 20", "Table 1", "Table 2", "1638.783", "<svg"):
        assert said in page
    record = read_record([tmp_path / "two_moving_outputs_housing_end.mcap"])
    assert len(record["ft"]) == 20 * 280


def test_a_duration_that_is_too_short_is_refused(tmp_path, capsys):
    assert main(["paper", "--duration", "2", "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err == "rsea paper: --duration 2 s, expected at least 20 s\n"
    assert not (tmp_path / "x").exists()
