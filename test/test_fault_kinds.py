"""Every kind of fault of the code is in one table, and in the docs."""

import ast
from collections.abc import Iterator
from pathlib import Path

from import_graph import nodes, tree_of

from msg_adapters.decoding import COUNTERS
from rsea_ros.checks.faults import FINDERS
from rsea_ros.records.record import FAULT_KINDS

ROOT = Path(__file__).resolve().parents[1]
TELLING = {"Fault", "tell", "add"}


def _literal_kinds() -> Iterator[str]:
    """Yield the kinds in the calls of Fault, tell and add in the readers and the core."""
    for folder in ("msg_adapters", "rsea_ros/checks", "rsea_ros/diagnosis", "rsea_ros/identification"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in nodes(tree_of(path)):
                if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
                    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
                    if name in TELLING and isinstance(node.args[0].value, str):
                        yield node.args[0].value


def test_the_table_has_every_kind():
    kinds = (
        {kind for kind in _literal_kinds() if "_" in kind} | set(FINDERS) | {k for k, _ in COUNTERS.values()}
    )
    assert {"damaged_chunks", "missing_topic", "cut_off", "coarse_steps", "nan"} <= kinds
    assert kinds <= set(FAULT_KINDS)


def test_the_docs_have_the_table_of_faults():
    text = (ROOT / "docs" / "bags.md").read_text()
    for kind, meaning in FAULT_KINDS.items():
        assert f"| `{kind}` | {meaning} |" in text
