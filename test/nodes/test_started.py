"""Every node starts as a program: `python -m rsea_ros.nodes.NAME` is what rsea run and rsea watch begin."""

from __future__ import annotations

import runpy
import sys
import warnings

import pytest

from rsea_ros.nodes._policies import NODES


@pytest.mark.parametrize(("name", "module"), NODES.items())
def test_a_node_is_a_program(name, module, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as left:
        warnings.simplefilter("ignore", RuntimeWarning)  # it has been imported before, and runs once more
        runpy.run_module(module, run_name="__main__")
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: ros2 run rsea_ros {name} ")
