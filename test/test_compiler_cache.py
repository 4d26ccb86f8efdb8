"""Compiled code is kept where the user can write, and is recompiled when its sources change."""

import ast
import errno
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest
from import_graph import tree_of
from numba.core import config

from rsea_ros import compiler, compiler as compiler_cache
from rsea_ros.compiler import SHARED, _own_cache, cache_folder, njit, shared_key, trusted_cache

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "rsea_ros"
def compiled_functions(tree: ast.Module) -> list[ast.FunctionDef]:
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    return [
        f
        for f in functions
        if any(("njit" in d) or (d in ("compiled", "inner")) for d in map(ast.unparse, f.decorator_list))
    ]


def imported_files(tree: ast.Module) -> dict[str, Path]:
    """Return the file of this package that each imported name comes from, by local name."""
    files = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rsea_ros"):
            for alias in node.names:
                path = ROOT / str(node.module).replace(".", "/")
                inner = path / f"{alias.name}.py"
                files[alias.asname or alias.name] = inner if inner.exists() else path.with_suffix(".py")
    return files


def test_the_key_covers_every_file_compiled_into_others():
    shared = {file for pattern in SHARED for file in PACKAGE.glob(pattern)}
    seen = 0
    for file in PACKAGE.rglob("*.py"):
        tree = tree_of(file)
        files = imported_files(tree)
        for function in compiled_functions(tree):
            body = (node for statement in function.body for node in ast.walk(statement))
            names = {node.id for node in body if isinstance(node, ast.Name)}
            used = {files[name] for name in names & files.keys()}
            assert used <= shared, f"{file.name}: {function.name} uses {used - shared}"
            seen += len(used)
    assert seen > 20


def test_the_key_follows_the_contents(tmp_path):
    copy = shutil.copytree(PACKAGE, tmp_path / "rsea_ros", ignore=shutil.ignore_patterns("__pycache__"))
    assert shared_key(copy) == shared_key(PACKAGE)
    (copy / "model" / "rig.py").write_text("")
    assert shared_key(copy) == shared_key(PACKAGE)
    (copy / "effects" / "_friction.py").write_text("")
    assert shared_key(copy) != shared_key(PACKAGE)
    assert cache_folder().name == shared_key(PACKAGE), "where compiled code is kept"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder for temporary files, open to everyone like /tmp; the home's cache is {tmp}/home."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return folder


@pytest.mark.parametrize("home", ["/proc/nothing", "relative", "/dev/null"])
def test_without_a_writable_home_the_temporary_folder_is_used(temporary, monkeypatch, home):
    monkeypatch.setenv("XDG_CACHE_HOME", home)
    assert trusted_cache("key") == temporary / f"rsea_ros-{os.geteuid()}" / "key"


def test_the_cache_in_the_home_is_private_to_its_user(temporary, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "new" / "cache"))
    before = os.umask(0)
    try:
        folder = trusted_cache("key")
    finally:
        os.umask(before)
    assert folder == tmp_path / "new" / "cache" / "rsea_ros" / "key"
    assert [path.stat().st_mode & 0o777 for path in (folder, folder.parent)] == [0o700, 0o700]
    assert trusted_cache("key") == folder
    folder.chmod(0o755)  # others may have changed its content
    assert trusted_cache("key").parent.parent == temporary


def plant(folder: Path, how: str) -> None:
    """Make a folder that another user can fill."""
    if how == "a link":
        (folder.parent / "elsewhere").mkdir()
        folder.symlink_to(folder.parent / "elsewhere")
        return
    folder.mkdir()
    folder.chmod({"open to the group": 0o770, "open to all": 0o777}.get(how, 0o700))


PLANTED = ["a link", "open to the group", "open to all", "another's"]


@pytest.mark.parametrize("how", PLANTED)
def test_a_planted_folder_is_not_used(temporary, tmp_path, monkeypatch, how):
    home, usual = tmp_path / "home" / "rsea_ros", temporary / f"rsea_ros-{os.geteuid()}"
    home.parent.mkdir()
    plant(home, how)
    others = {home} if how == "another's" else set()
    of_others(monkeypatch, others)
    assert trusted_cache("key") == usual / "key"
    shutil.rmtree(usual)
    plant(usual, how)
    others |= {usual} if how == "another's" else set()
    fresh = trusted_cache("key")
    assert fresh.parent == temporary and fresh not in (home, usual)
    assert fresh.stat().st_mode & 0o777 == 0o700 and not list(fresh.iterdir())


def of_others(monkeypatch, folders: set[Path]) -> None:
    """Give some folders to another user."""
    true = {name: getattr(Path, name) for name in ("stat", "lstat")}

    def change(name):
        def look(path, **options):
            seen = true[name](path, **options)
            owner = os.geteuid() + 1 if path in folders else seen.st_uid
            return os.stat_result((*seen[:4], owner, *seen[5:]))

        return look

    for name in true:
        monkeypatch.setattr(Path, name, change(name))


def compiled_anew(limit: int | None = None):
    """Return the value of a newly compiled function at 1.0; limit: largest size of a file, bytes."""

    @njit(cache=True)
    def double(x):
        return 2.0 * x

    if limit is None:
        return double(1.0)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        return double(1.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.fixture
def kept_in(tmp_path, monkeypatch):
    """Return the folder of compiled code, and forget that a warning was given."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    compiler.warn_once.cache_clear()
    yield tmp_path
    compiler.warn_once.cache_clear()


def test_a_full_disk_costs_the_cache_and_one_line(kept_in, caplog):
    assert compiled_anew(limit=100) == compiled_anew(limit=100) == 2.0
    assert [p for p in kept_in.rglob("*") if p.is_file()] == []
    (line,) = caplog.messages
    assert "not kept" in line and "File too large" in line


@pytest.mark.parametrize(("suffix", "size"), [(".nbi", 0), (".nbc", 40)])
def test_a_damaged_cache_file_is_recompiled(kept_in, caplog, suffix, size):
    assert compiled_anew() == 2.0
    (file,) = (p for p in kept_in.rglob("*") if p.suffix == suffix)
    os.truncate(file, size)
    assert compiled_anew() == 2.0
    assert file.stat().st_size > 80
    assert caplog.messages == []


def test_no_folder_at_all_costs_the_cache_and_one_line(kept_in, caplog, monkeypatch):
    def full(prefix):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr(compiler_cache, "private", lambda folder, forbidden=0: False)
    monkeypatch.setattr(tempfile, "mkdtemp", full)
    compiler._folder.cache_clear()
    try:
        assert compiled_anew() == compiled_anew() == 2.0
    finally:
        compiler._folder.cache_clear()
    (line,) = caplog.messages
    assert "No space left" in line


START = """
import sys
import numpy as np
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel
t = np.arange(20) / 280.0
synthesize(load_rig("paper_high_impedance"), Channel(t, t))
print(sorted({"numba.np.linalg", "numba.np.npyimpl", "scipy.fft", "scipy.special"} & set(sys.modules)))
"""


def test_kept_code_runs_without_the_compiler() -> None:
    for _ in range(2):  # the first may have to compile
        command = [sys.executable, "-c", START]
        loaded = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
        if loaded == "[]":
            return
    raise AssertionError(f"kept code was run with {loaded}")


def test_one_process_compiles_at_a_time_and_nobody_waits_for_one_that_hangs(tmp_path, monkeypatch):
    """Two workers compiled the same functions at once."""
    monkeypatch.setattr(compiler, "PATIENCE", 0.05)
    mine, others = compiler._Turn(), compiler._Turn()
    assert mine.take(str(tmp_path)) and not mine.take(str(tmp_path))
    assert not others.take(str(tmp_path))
    mine.give_back()
    assert others.take(str(tmp_path)) and not mine.take(str(tmp_path))
    others.give_back()
    assert not mine.take(str(tmp_path / "nowhere"))


def test_functions_of_other_packages_keep_their_cache(monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", "")
    with _own_cache():
        assert Path(config.CACHE_DIR) == cache_folder()
    assert config.CACHE_DIR == ""


def test_a_thread_does_not_take_the_folder_from_another(monkeypatch):
    """Code compiled in two threads at once was kept in the working directory."""
    monkeypatch.setattr(config, "CACHE_DIR", "")
    entered, left, seen = threading.Event(), threading.Event(), []

    def other():
        with _own_cache():
            entered.set()
            left.wait(10.0)
            seen.append(config.CACHE_DIR)

    thread = threading.Thread(target=other)
    with _own_cache():
        thread.start()
        entered.wait(0.1)
    left.set()
    thread.join()
    assert (seen, config.CACHE_DIR) == ([str(cache_folder())], "")


def test_a_cache_folder_that_the_user_names_is_used(monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", "/somewhere")
    with _own_cache():
        assert config.CACHE_DIR == "/somewhere"


@pytest.mark.parametrize("how", ["open to all", "another's"])
def test_a_folder_inside_another_users_folder_is_not_used(temporary, tmp_path, monkeypatch, how):
    plant(tmp_path / "home", how)
    of_others(monkeypatch, {tmp_path / "home"} if how == "another's" else set())
    assert trusted_cache("key").parent.parent == temporary
