"""`rsea design` and `rsea paper` as a user runs them."""

from __future__ import annotations

import pytest

from rsea_ros.cli.main import main


@pytest.fixture
def directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_fail_on_makes_the_result_of_a_design_an_exit_status(directory):
    assert main(["design", "--fail-on", "unmet"]) == 1
    assert main(["design", "--fail-on", "unmet", "--stiffness", "4000"]) == 0
