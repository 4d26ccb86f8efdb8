"""Test every supported Python: the locked environment, the wheel and the fast part of the suite.

Nodes are left out: .ci/run tries them, on GitHub with each version. A missing version counts as untried.
"""

import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from pathlib import Path
from typing import Annotated

from bench import ROOT
from bench.results import Row

VERSIONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
FAST = (
    "test_units.py", "test_strict_yaml.py", "test_stamps.py", "test_imports.py",
    "effects", "model", "library", "checks", "msg_adapters",
)  # fmt: skip
NODES = re.compile(r"rclpy|msg_adapters\.ros|rsea_ros\.nodes")
USE = "import rsea_ros as rsea; rsea.simulate('paper_high_impedance', [0.0, 1.0] * 300, rate=280.0)"


def main(*, only: Annotated[tuple[str, ...], VERSIONS] = VERSIONS) -> Generator[Row, None, int]:
    """Try each version; status 1 when one fails."""
    failed = []
    for version in only:
        begun = time.monotonic()
        result = try_version(version)
        failed += [version] * result.startswith("failed")
        yield Row(version, "", {"result": result, "time, s": f"{time.monotonic() - begun:.0f}"})
    return int(bool(failed))


def try_version(version: str) -> str:
    """Try a version and return passed, at which step it failed, or untried."""
    interpreter = interpreter_of(version)
    if interpreter is None:
        return "untried: not installed on this machine"
    with tempfile.TemporaryDirectory() as folder:
        failed = next((name for name, command in steps(interpreter, Path(folder)) if not runs(command)), None)
    return f"failed at: {failed}" if failed else "passed"


def interpreter_of(version: str) -> str | None:
    """Return a command that is this version, of the PATH or of pyenv."""
    names = [f"python{version}", *map(str, Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))]
    code = f"import sys; sys.exit('{version}' != '%d.%d' % sys.version_info[:2])"
    return next((name for name in names if runs([name, "-c", code], show=False)), None)


def steps(interpreter: str, folder: Path) -> list[tuple[str, list[str]]]:
    """Return name and command of each step, in a folder of their own."""
    source = folder / "source"
    python = str(folder / "environment" / "bin" / "python")
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    names = ("run", "dev") if platform.machine() != "x86_64" else ("run", "ros", "dev")
    locks = [option for name in names for option in ("-r", str(ROOT / "requirements" / f"{name}.lock"))]
    return [
        ("environment", [interpreter, "-m", "venv", str(folder / "environment")]),
        ("locks", [*pip, "--require-hashes", "--only-binary", ":all:", *locks]),
        ("source", ["sh", "-c", f"mkdir {source} && git -C {ROOT} archive HEAD | tar -x -C {source}"]),
        ("wheel", [*pip, str(source)]),
        ("use of the wheel", ["sh", "-c", f'cd {folder} && {python} -c "{USE}"']),
        ("tests", ["sh", "-c", f"cd {source} && {python} -m pytest -q -x -n 2 {' '.join(fast_tests())}"]),
    ]


def fast_tests() -> list[str]:
    """Return the test files of the fast part that need no ROS, relative to the root."""
    parts = [ROOT / "test" / name for name in FAST]
    files = [f for part in parts for f in ([part] if part.is_file() else sorted(part.rglob("test_*.py")))]
    without_ros = (f for f in files if not NODES.search(f.read_text(encoding="utf-8")))
    return [str(f.relative_to(ROOT)) for f in without_ros]


def runs(command: list[str], *, show: bool = True) -> bool:
    """Run a command and return whether it succeeded; show the end of the output of a failed one."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        return False
    if done.returncode and show:
        print(f"{done.stdout[-1500:]}{done.stderr[-1500:]}", file=sys.stderr)
    return done.returncode == 0
