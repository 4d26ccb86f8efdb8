"""./rsea makes its environment once, never uses a half-made one, and says in one line why it cannot."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import venv
from collections.abc import Iterator
from pathlib import Path

import pip
import pytest

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ("requirements.lock", "requirements-ros.lock")
PACKAGE = 'import sys\nprint("ran", *sys.argv[1:])\n'
DECOY = PACKAGE if sys.version_info < (3, 11) else 'print("from the working directory")\n'
FOREIGN = ("ROS_", "AMENT_", "PYTHON", "_ROS")
LINK_PIP = f"""
import glob, os, venv
def link_pip(self, context):
    (place,) = glob.glob(os.path.join(glob.escape(context.env_dir), "lib", "python3*", "site-packages"))
    os.symlink({str(Path(pip.__file__).parent)!r}, os.path.join(place, "pip"))
venv.EnvBuilder._setup_pip = link_pip
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a repository with the real launcher, locks without packages, and a package that says it ran.

    The directory from which it is called holds another package of that name, which must not run.
    """
    root = tmp_path / "a clone"
    shutil.copytree(ROOT / "launcher", root / "launcher", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "rsea", root / "rsea")
    for name in LOCKS:
        (root / name).touch()
    for place, code in ((root, PACKAGE), (tmp_path, DECOY)):
        (place / "rsea_ros").mkdir()
        (place / "rsea_ros" / "__main__.py").write_text(code)
    return root


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where a Python lies whose environments get a link to a pip, which takes seconds to unpack."""
    place = tmp_path_factory.mktemp("python")
    venv.create(place, symlinks=True)
    (packages,) = place.glob("lib/python3*/site-packages")
    (packages / "link_pip.py").write_text(LINK_PIP)
    (packages / "link_pip.pth").write_text("import link_pip\n")
    return place / "bin"


@pytest.fixture
def silent_server() -> Iterator[socket.socket]:
    """Listen as a package server that takes requests and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60)
        yield server


def start(root: Path, path: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    """Start the launcher in a process group of its own, with the Python of `path` first on PATH."""
    search = os.pathsep.join([str(path), os.environ["PATH"]])
    inherited = {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}
    return subprocess.Popen(
        [str(root / "rsea"), *arguments], cwd=root.parent, text=True, start_new_session=True,
        env=inherited | {"PATH": search, "no_proxy": "127.0.0.1"} | environment,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )


def run(root: Path, path: Path, *arguments: str, **environment: str) -> tuple[int, str, str]:
    """Run the launcher to its end and return status, stdout, stderr."""
    process = start(root, path, *arguments, **environment)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def ask_for(root: Path, server: tuple[str, int]) -> None:
    """Put a package of that server into the lock."""
    (root / LOCKS[0]).write_text(f"slow @ http://{server[0]}:{server[1]}/slow-1.0.tar.gz\n")


def fake_python(directory: Path, body: str) -> Path:
    """Make every name under which the launcher looks for Python a shell script with that body."""
    directory.mkdir()
    for name in ("python3", *(f"python3.{minor}" for minor in range(10, 15))):
        (directory / name).write_text(f"#!/bin/sh\n{body}\n")
        (directory / name).chmod(0o755)
    return directory


def test_the_environment_is_made_once_and_anew_when_the_lock_changes(clone, quick):
    both = [start(clone, quick, "verb", "--flag", "two words") for _ in range(2)]
    ends = [process.communicate(timeout=120) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert [out for out, _ in ends] == ["ran verb --flag two words\n"] * 2
    assert sum(err.count("making .venv with") for _, err in ends) == 1
    assert run(clone, quick, "verb") == (0, "ran verb\n", "")

    (clone / LOCKS[1]).write_text("# changed\n")
    status, out, err = run(clone, quick)
    assert (status, out) == (0, "ran\n")
    assert "making .venv with" in err
    assert run(clone, quick) == (0, "ran\n", "")


def test_an_environment_behind_a_link_is_never_cleared(clone, quick, tmp_path):
    """With another lock, the environment of another clone behind a link was cleared."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "kept").touch()
    (clone / ".venv").symlink_to(elsewhere)
    status, out, err = run(clone, quick)
    assert (status, out) == (2, "") and f"{clone}/.venv: a link" in err
    assert (elsewhere / "kept").exists()


def test_an_interrupted_environment_is_never_used(clone, quick, silent_server):
    ask_for(clone, silent_server.getsockname())
    connections = []
    for end, status in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)):
        process = start(clone, quick)
        connections.append(silent_server.accept()[0])
        os.killpg(process.pid, end)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (status, "")
    assert "interrupted" in err.splitlines()[-1]
    for connection in connections:
        connection.close()

    (clone / LOCKS[0]).write_text("")
    status, out, err = run(clone, quick)
    assert (status, out) == (0, "ran\n")
    assert "making .venv with" in err


def test_without_network_it_says_so(clone, quick, silent_server):
    address = silent_server.getsockname()
    silent_server.close()
    ask_for(clone, address)
    status, out, err = run(clone, quick)
    assert (status, out) == (2, "")
    assert err.splitlines()[-1].startswith("rsea: no network: the package index does not answer")


def test_a_sourced_ros_is_used_instead_of_the_wheels(clone, quick, tmp_path):
    ros = tmp_path / "ros"
    ros.mkdir()
    (ros / "rclpy.py").write_text("")
    (clone / LOCKS[1]).write_text("./the-wheels-must-not-be-installed\n")
    (clone / "rsea_ros" / "__main__.py").write_text("import rclpy\nprint(rclpy.__file__)\n")
    sourced = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": str(ros), "PYTHONPATH": str(ros)}
    status, out, err = run(clone, quick, **sourced)
    assert (status, out) == (0, f"{ros / 'rclpy.py'}\n")
    assert "sourced ROS 2 jazzy" in err
    assert "include-system-site-packages = true" in (clone / ".venv" / "pyvenv.cfg").read_text()
    assert run(clone, quick, **sourced) == (0, f"{ros / 'rclpy.py'}\n", "")


def test_a_python_too_old_is_named(clone, tmp_path):
    old = fake_python(tmp_path / "bin", 'if [ "$1" = --version ]; then echo Python 3.8.10; else exit 1; fi')
    assert run(clone, old) == (2, "", "rsea: Python 3.10 to 3.14 needed, found Python 3.8.10\n")


def test_a_python_without_venv_is_named(clone, tmp_path):
    bare = fake_python(tmp_path / "bin", 'case "$2" in *venv*) exit 1;; esac; exit 0')
    status, out, err = run(clone, bare)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert f"{bare}/python3 has no venv" in err


def test_the_locks_pin_every_package_with_hashes():
    for name in LOCKS:
        pins = [line for line in (ROOT / name).read_text().splitlines() if line[:1].isalpha()]
        assert pins
        assert all("==" in pin and pin.endswith("\\") for pin in pins)
