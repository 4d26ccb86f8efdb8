"""./rsea makes its environment once, from the locks alone, uses no half-made one, says why it cannot."""

import hashlib
import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path

import pip
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
USED = ("run", "ros", "can", "fleet", "export", "dev")
"""Locks of which `./rsea test` makes its environment."""
PACKAGE = 'import sys\nprint("ran", *sys.argv[1:])\n'
DECOY = PACKAGE if sys.version_info < (3, 11) else 'print("from the working directory")\n'
FOREIGN = ("ROS_", "AMENT_", "PYTHON", "_ROS", "PIP_")
PIP = """
import os, runpy, sys
if any(os.path.getsize(file) for option, file in zip(sys.argv, sys.argv[1:]) if option == "-r"):
    sys.path.insert(0, {real!r})
    del sys.modules["pip"]
    runpy.run_module("pip", run_name="__main__", alter_sys=True)
"""
LINK_PIP = """
import glob, os, venv
def link_pip(self, context):
    (place,) = glob.glob(os.path.join(glob.escape(context.env_dir), "lib", "python3*", "site-packages"))
    os.symlink({lazy!r}, os.path.join(place, "pip"))
venv.EnvBuilder._setup_pip = link_pip
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a repository with the real launcher, locks without packages, and a package that says it ran.

    The directory from which it is called holds another package of that name, which must not run.
    """
    root = tmp_path / "ein Klön"
    shutil.copytree(ROOT / "launcher", root / "launcher", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "rsea", root / "rsea")
    (root / "requirements").mkdir()
    for name in USED:
        (root / "requirements" / f"{name}.lock").touch()
    for place, code in ((root, PACKAGE), (tmp_path, DECOY)):
        (place / "rsea_ros").mkdir()
        (place / "rsea_ros" / "__main__.py").write_text(code)
    return root


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where a Python lies whose environments get a link to a pip, which takes seconds to unpack.

    Where all locks are empty that pip has nothing to do, and does not import the real one to find that out.
    """
    place = tmp_path_factory.mktemp("python")
    venv.create(place, symlinks=True)
    for folder in ("real", "lazy"):
        (place / folder).mkdir()
    (place / "real" / "pip").symlink_to(Path(pip.__file__).parent)
    (place / "lazy" / "__init__.py").touch()
    (place / "lazy" / "__main__.py").write_text(PIP.format(real=str(place / "real")))
    (packages,) = place.glob("lib/python3*/site-packages")
    (packages / "link_pip.py").write_text(LINK_PIP.format(lazy=str(place / "lazy")))
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
    inherited |= {"HOME": "/dev/null/nothing", "PIP_CONFIG_FILE": os.devnull}
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


def lock(root: Path, name: str = "run") -> Path:
    """Return a lock of a clone."""
    return root / "requirements" / f"{name}.lock"


def ask_for(root: Path, server: tuple[str, int], name: str = "run") -> None:
    """Put a package of that server into a lock."""
    url = f"http://{server[0]}:{server[1]}/slow-1.0-py3-none-any.whl"
    lock(root, name).write_text(f"slow @ {url} --hash=sha256:{'0' * 64}\n")


def wheel(place: Path, name: str, version: str, *requires: str) -> Path:
    """Write a wheel without code and return its path."""
    about = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    files = {
        "METADATA": about + "".join(f"Requires-Dist: {one}\n" for one in requires),
        "WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    folder = f"{name}-{version}.dist-info"
    record = "".join(f"{folder}/{file},,\n" for file in (*files, "RECORD"))
    path = place / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for file, text in {**files, "RECORD": record}.items():
            archive.writestr(f"{folder}/{file}", text)
    return path


def index(place: Path, packages: Mapping[str, Mapping[str, tuple[str, ...]]], yanked: str = "") -> str:
    """Write a package index (name, versions, what each asks for) and return its address."""
    for name, versions in packages.items():
        (place / name).mkdir(parents=True)
        links = []
        for version, requires in versions.items():
            file = wheel(place / name, name, version, *requires)
            mark = ' data-yanked="withdrawn"' if f"{name} {version}" == yanked else ""
            links.append(f'<a href="{file.name}"{mark}>{file.name}</a>')
        (place / name / "index.html").write_text(f"<!doctype html><body>{''.join(links)}</body>")
    return place.as_uri()


def pinned(place: Path, *pins: str) -> str:
    """Return a lock of "NAME VERSION" in an index, with hashes."""
    lines = []
    for name, version in map(str.split, pins):
        content = (place / name / f"{name}-{version}-py3-none-any.whl").read_bytes()
        lines.append(f"{name}=={version} --hash=sha256:{hashlib.sha256(content).hexdigest()}\n")
    return "".join(lines)


def installed(root: Path) -> set[str]:
    """Return what the environment of a clone has, as "NAME VERSION", beside pip and its like."""
    (packages,) = (root / ".venv").glob("lib/python3*/site-packages")
    found = {f"{one.name} {one.version}" for one in metadata.distributions(path=[str(packages)])}
    return {one for one in found if one.split()[0] not in ("pip", "setuptools")}


def fake_python(directory: Path, body: str) -> Path:
    """Make every name under which the launcher looks for Python a shell script with that body."""
    directory.mkdir()
    for name in ("python3", *(f"python3.{minor}" for minor in range(10, 15))):
        (directory / name).write_text(f"#!/bin/sh\n{body}\n")
        (directory / name).chmod(0o755)
    return directory


def test_the_environment_is_made_once_and_anew_when_a_lock_changes_and_no_half_made_one_is_used(
    clone, quick, silent_server
):
    both = [start(clone, quick, "verb", "--flag", "two words") for _ in range(2)]
    ends = [process.communicate(timeout=120) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert [out for out, _ in ends] == ["ran verb --flag two words\n"] * 2
    assert sum(err.count("making .venv with") for _, err in ends) == 1
    assert run(clone, quick, "verb") == (0, "ran verb\n", "")

    ask_for(clone, silent_server.getsockname(), "ros")
    process = start(clone, quick)
    connection = silent_server.accept()[0]
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    connection.close()
    assert (process.returncode, out) == (130, "") and "interrupted" in err.splitlines()[-1]

    lock(clone, "ros").write_text("")  # as at first: what lies there would fit
    status, out, err = run(clone, quick)
    assert (status, out) == (0, "ran\n") and "making .venv with" in err
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


def test_without_network_it_says_so_beside_any_modules_of_the_user(clone, quick, silent_server, tmp_path):
    address = silent_server.getsockname()
    silent_server.close()
    ask_for(clone, address)
    (tmp_path / "platform.py").touch()
    status, out, err = run(clone, quick, PYTHONPATH=str(tmp_path))
    assert (status, out) == (2, "")
    assert err.splitlines()[-1].startswith("rsea: no network: the package index does not answer")


def test_a_sourced_ros_is_used_instead_of_the_wheels(clone, quick, tmp_path):
    ros = tmp_path / "ros"
    ros.mkdir()
    (ros / "rclpy.py").write_text("")
    lock(clone, "ros").write_text("./the-wheels-must-not-be-installed\n")
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


def test_what_is_released_tomorrow_changes_nothing(clone, quick, tmp_path):
    """A release of a package that only another one asked for, outside the lock, stopped every new machine."""
    place = tmp_path / "tomorrow"
    address = index(
        place,
        {
            "drive": {"1.0": ("tool[extra]",), "2.0": ("tool[extra]",)},
            "tool": {"1.0": ("helper ; extra == 'extra'",), "2.0": ("helper",)},
            "helper": {"1.0": (), "9.0": ()},
        },
        yanked="tool 1.0",
    )
    lock(clone).write_text(pinned(place, "drive 1.0", "tool 1.0"))
    status, out, err = run(clone, quick, "verb", PIP_INDEX_URL=address)
    assert (status, out) == (0, "ran verb\n"), err
    assert installed(clone) == {"drive 1.0", "tool 1.0"}
    assert run(clone, quick, "verb", PIP_INDEX_URL="file:///nowhere") == (0, "ran verb\n", "")

    lock(clone).write_text(f"drive==1.0 --hash=sha256:{'0' * 64}\n")
    status, out, err = run(clone, quick, PIP_INDEX_URL=address)
    assert (status, out) == (2, "") and err.splitlines()[-1].startswith("rsea: ")


def test_a_verb_adds_what_it_needs_once(clone, quick, tmp_path, silent_server):
    place = tmp_path / "packages"
    address = index(place, {"base": {"1.0": ()}, "pool": {"1.0": ("newer",)}})
    for name, pin in (("run", "base 1.0"), ("fleet", "pool 1.0")):
        lock(clone, name).write_text(pinned(place, pin))
    assert run(clone, quick, "demo", PIP_INDEX_URL=address)[:2] == (0, "ran demo\n")
    assert installed(clone) == {"base 1.0"}
    assert run(clone, quick, "export", "--help") == (0, "ran export --help\n", "")

    begun, wheels = lock(clone, "fleet").read_text(), silent_server
    ask_for(clone, wheels.getsockname(), "fleet")
    process = start(clone, quick, "fleet", PIP_INDEX_URL=address)
    connection = wheels.accept()[0]
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate(timeout=60)
    connection.close()
    lock(clone, "fleet").write_text(begun)
    status, out, err = run(clone, quick, "demo", PIP_INDEX_URL=address)
    assert (status, out) == (0, "ran demo\n") and "making .venv" in err, "a killed part was used"

    status, out, err = run(clone, quick, "fleet", "--help", PIP_INDEX_URL=address)
    assert (status, out) == (0, "ran fleet --help\n"), "help of fleet imports its packages"
    assert err.splitlines() == [f"rsea: adding fleet to .venv, this once: {environment().PARTS['fleet']}"]
    assert run(clone, quick, "fleet", "run") == (0, "ran fleet run\n", "")
    assert installed(clone) == {"base 1.0", "pool 1.0"}


def environment():
    """Return launcher/environment.py as a module."""
    spec = importlib.util.spec_from_file_location("environment", ROOT / "launcher" / "environment.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("machine", "libc", "says"),
    [
        ("x86_64", "", "no glibc here (musl?), expected 2.28 or later"),
        ("aarch64", "glibc 2.27", "glibc 2.27, expected 2.28 or later"),
        ("armv7l", "glibc 2.36", "armv7l: no wheels for it, expected x86_64, or aarch64 without nodes"),
    ],
)
def test_a_machine_without_wheels_is_refused_in_one_line(machine, libc, says):
    launcher = environment()
    with pytest.raises(launcher.InstallError) as error:
        launcher.wheels(machine, libc)
    assert str(error.value).startswith(says) and "\n" not in str(error.value)


def test_an_arm_computer_gets_all_but_the_nodes():
    launcher = environment()
    assert launcher.wheels("x86_64", "glibc 2.36") == "wheels"
    assert launcher.wheels("aarch64", "glibc 2.36") == "none"


def test_the_environment_of_the_tests_is_that_of_the_locks():
    """And the locks are complete: they have what their packages ask for, whatever is released tomorrow."""
    ros = (ROOT / ".venv" / "complete").read_text().splitlines()[1]
    names = {}
    for name in (name for name in USED if name != "ros" or ros == "wheels"):
        lines = lock(ROOT, name).read_text().splitlines()
        pins = [line.removesuffix("\\") for line in lines if line[:1].isalnum()]
        assert pins and all(f"{pin}\\" in lines and "==" in pin for pin in pins), "a pin without a hash"
        for pin in map(Requirement, pins):
            if pin.marker is None or pin.marker.evaluate():
                assert names.setdefault(canonicalize_name(pin.name), str(pin.specifier)) == str(pin.specifier)
    assert {name: f"=={metadata.version(name)}" for name in names} == names
    asked = [(name, one) for name in names for one in needs(name, "")]
    asked += [(str(one), two) for _, one in asked for extra in one.extras for two in needs(one.name, extra)]
    missing = {f"{name}: {one}" for name, one in asked if canonicalize_name(one.name) not in {*names, "empy"}}
    assert not missing, "empy builds messages, which the wheels have built"


def needs(name: str, extra: str) -> list[Requirement]:
    """Return what an installed package asks for on this machine."""
    found = map(Requirement, metadata.requires(name) or ())
    return [one for one in found if one.marker is None or one.marker.evaluate({"extra": extra})]
