"""The extras are found without metadata, and need all that they are offered."""

from __future__ import annotations

import ast
import importlib
from collections import defaultdict

import pytest
from import_graph import MODULES, ROOT, imports, nodes, tree_of

from rsea_ros import plugins
from rsea_ros.cli import main as cli
from rsea_ros.cli.export import ABOUT
from test.test_imports import PUBLIC


def test_the_verbs_targets_and_nodes_of_the_extras_are_those_that_are_known(monkeypatch):
    monkeypatch.setattr(plugins, "installed", lambda group: pytest.fail("looked through everything"))
    assert {verb: cli.module_of(verb) for verb in cli.EXTRA} == plugins.in_extras(plugins.VERBS)
    assert {"mjcf", *plugins.in_extras(plugins.TARGETS)} == set(ABOUT)
    assert plugins.node_modules()["watch"] == "rsea_extras.watch.node"


def test_an_empty_name_is_no_folder_of_recordings(capsys):
    with pytest.raises(SystemExit):
        cli.main(["watch", "--out", ""])
    assert "'', expected a name" in capsys.readouterr().err


def test_the_extras_build_on_few_public_modules():
    used = {m for p in MODULES if p.is_relative_to(ROOT / "rsea_extras") for m, _ in imports(p, tree_of(p))}
    assert {m for m in used if m.startswith("rsea_ros.ext")} == {m for m in PUBLIC if m != "rsea_ros"}
    assert len(PUBLIC) <= 8


def test_the_extension_offers_what_the_extras_use_and_nothing_else():
    """A name that nobody uses would bind its module for ever."""
    used: dict[str, set[str]] = defaultdict(set)
    for path in MODULES:
        if path.is_relative_to(ROOT / "rsea_extras"):
            found = nodes(tree_of(path))
            for node in (n for n in found if isinstance(n, ast.ImportFrom) and n.module):
                used[node.module] |= {alias.name for alias in node.names}
                if node.module == "rsea_ros.extension":
                    (as_,) = node.names
                    of = (n for n in found if isinstance(n, ast.Attribute) and _is_name(n.value, as_.asname))
                    used[f"{node.module}.{as_.name}"] |= {n.attr for n in of}
    for module in PUBLIC.keys() - {"rsea_ros"}:
        assert set(importlib.import_module(module).__all__) - used[module] == set(), module


def _is_name(node: ast.AST, name: str | None) -> bool:
    return isinstance(node, ast.Name) and node.id == name
