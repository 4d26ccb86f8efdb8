"""Only files.py writes: any other code that writes could replace a file or leave a partial one."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from import_graph import ROOT, found_in_modules

ALLOWED = {
    "rsea_ros/outputs/files.py",
    "rsea_ros/hardware/peer/serial_line.py",  # names a link to its terminal
    "msg_adapters/compression.py",  # unpacks into a temporary folder
}
WRITING = {"write_text", "write_bytes", "rename", "renames", "tofile", "savez", "save", "savetxt", "to_csv"}


def offences(path: Path, tree: ast.Module) -> list[int]:
    """Return the lines of a module that write a file without files.py."""
    if str(path.relative_to(ROOT)) in ALLOWED:
        return []
    return [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Call) and writes(node)]


def writes(call: ast.Call) -> bool:
    """Return whether a call writes a file: by its name, or by the mode that it opens one with."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name == "open":
        modes = [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        return any(set(mode) <= set("rwaxbt+") and set(mode) & set("wa+") for mode in modes)
    method = isinstance(call.func, ast.Attribute)
    on_os = method and isinstance(call.func.value, ast.Name) and call.func.value.id == "os"
    return (method and name in WRITING) or (on_os and name == "replace")


def test_a_module_writes_only_through_files():
    assert found_in_modules(offences) == []


@pytest.mark.parametrize(
    "source", ['p.write_text("x")', 'open(p, "w")', 'p.open("ab")', "os.replace(a, b)", "a.rename(b)"]
)
def test_an_offence_is_found(source):
    assert offences(ROOT, ast.parse(source)) == [1]


@pytest.mark.parametrize("source", ["write_text(p, s)", 'p.open("xb")', 'text.replace("a", "b")', "open(p)"])
def test_an_allowed_call_passes(source):
    assert offences(ROOT, ast.parse(source)) == []
