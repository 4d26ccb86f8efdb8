"""Compiled code is kept where the user can write, and never outlives what was compiled into it."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rsea_ros.compiler_cache import SHARED, shared_key, user_cache

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "rsea_ros"
EVALUATE = """
import ctypes
from rsea_ros.effects.coulomb_friction import EFFECT
from rsea_ros.effects.signal_table import CREEP, GEAR_TORQUE, GEAR_VELOCITY, SIZE
table, own = (ctypes.c_double * SIZE)(), (ctypes.c_double * 1)()
table[GEAR_VELOCITY], table[CREEP] = 1.0, 2e-3
EFFECT.function.ctypes(table, (ctypes.c_double * 1)(3.0), own)
print(table[GEAR_TORQUE])
"""


def evaluated(root: Path, cache: Path) -> float:
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(root), "XDG_CACHE_HOME": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", EVALUATE],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def test_a_changed_helper_is_compiled_anew(tmp_path):
    copy = shutil.copytree(PACKAGE, tmp_path / "rsea_ros", ignore=shutil.ignore_patterns("__pycache__"))
    assert evaluated(tmp_path, tmp_path / "cache") == -3.0
    helper = copy / "effects" / "_friction.py"
    text = helper.read_text()
    assert text.count("        return size\n") == 1
    helper.write_text(text.replace("        return size\n", "        return size * 2.0\n"))
    assert evaluated(tmp_path, tmp_path / "cache") == -6.0
    assert len(list((tmp_path / "cache" / "rsea_ros").iterdir())) == 2


def compiled_functions(tree: ast.Module) -> list[ast.FunctionDef]:
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return [
        f
        for f in functions
        if any(("njit" in d) or (d in ("compiled", "inner")) for d in map(ast.unparse, f.decorator_list))
    ]


def imported_files(tree: ast.Module) -> dict[str, Path]:
    """Return by local name the file of this package that a name comes from."""
    files = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rsea_ros"):
            for alias in node.names:
                path = ROOT / str(node.module).replace(".", "/")
                inner = path / f"{alias.name}.py"
                files[alias.asname or alias.name] = inner if inner.exists() else path.with_suffix(".py")
    return files


def test_all_that_is_compiled_into_other_files_is_in_the_key():
    shared = {file for pattern in SHARED for file in PACKAGE.glob(pattern)}
    seen = 0
    for file in PACKAGE.rglob("*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        files = imported_files(tree)
        for function in compiled_functions(tree):
            names = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}
            used = {files[name] for name in names & files.keys()}
            assert used <= shared, f"{file.name}: {function.name} uses {used - shared}"
            seen += len(used)
    assert seen > 20


def test_the_key_follows_the_contents(tmp_path):
    copy = shutil.copytree(PACKAGE, tmp_path / "rsea_ros", ignore=shutil.ignore_patterns("__pycache__"))
    assert shared_key(copy) == shared_key(PACKAGE)
    (copy / "model" / "rig.py").write_text("")
    assert shared_key(copy) == shared_key(PACKAGE)
    (copy / "effects" / "signal_table.py").write_text("")
    assert shared_key(copy) != shared_key(PACKAGE)


@pytest.mark.parametrize(
    ("home", "expected"),
    [
        ("{tmp}/new/cache", "{tmp}/new/cache/rsea_ros"),
        ("/proc/nothing", "{temporary}"),
        ("relative", "{temporary}"),
    ],
)
def test_a_home_that_cannot_be_written_gives_way(tmp_path, monkeypatch, home, expected):
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "temporary"))
    monkeypatch.setenv("XDG_CACHE_HOME", home.format(tmp=tmp_path))
    monkeypatch.setattr(os, "access", lambda path, mode: not str(path).startswith("/proc"))
    temporary = tmp_path / "temporary" / f"rsea_ros-{os.getuid()}"
    assert user_cache() == Path(expected.format(tmp=tmp_path, temporary=temporary))
