"""Only files.py writes: any other code that writes could replace a file or leave a partial one."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MODULES = sorted(path for top in ("rsea_ros", "msg_adapters") for path in (ROOT / top).rglob("*.py"))
ALLOWED = {
    "rsea_ros/outputs/files.py",
    "rsea_ros/hardware/peer/serial_line.py",  # names a link to its terminal
    "msg_adapters/compression.py",  # unpacks into a temporary folder
}
WRITING = {"write_text", "write_bytes", "rename", "renames", "tofile", "savez", "save", "savetxt", "to_csv"}


def offences(source: str) -> list[int]:
    """Return the lines of a source that write a file without files.py."""
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    return [call.lineno for call in calls if writes(call)]


def writes(call: ast.Call) -> bool:
    """Return whether a call writes a file: by its name, or by the mode that it opens one with."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name == "open":
        modes = [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        return any(set(mode) <= set("rwaxbt+") and set(mode) & set("wa+") for mode in modes)
    method = isinstance(call.func, ast.Attribute)
    on_os = method and isinstance(call.func.value, ast.Name) and call.func.value.id == "os"
    return (method and name in WRITING) or (on_os and name == "replace")


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_writes_only_through_files(path):
    if str(path.relative_to(ROOT)) not in ALLOWED:
        assert offences(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source", ['p.write_text("x")', 'open(p, "w")', 'p.open("ab")', "os.replace(a, b)", "a.rename(b)"]
)
def test_an_offence_is_found(source):
    assert offences(source) == [1]


@pytest.mark.parametrize("source", ["write_text(p, s)", 'p.open("xb")', 'text.replace("a", "b")', "open(p)"])
def test_an_allowed_call_passes(source):
    assert offences(source) == []
