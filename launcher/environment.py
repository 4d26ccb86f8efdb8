"""Make .venv from the locks; ./rsea calls `environment.py ROOT wheels|sourced KEY "PART …" [ARGUMENT…]`.

Standard library only. No resolver runs: pip installs what the locks name, as wheels with these hashes, and
nothing else. The stamp `.venv/complete` (the key, and where ROS 2 comes from: wheels, sourced or none) is
written last and by rename, and is away while a part is added: an environment without it is never used,
whatever interrupted its making.
"""

from __future__ import annotations

import fcntl
import os
import platform
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

NETWORK_SIGNS = ("connection broken", "Max retries exceeded", "name resolution", "timed out")
PIP_INSTALL = (
    "-Im", "pip", "install", "--no-input", "--progress-bar=off", "--retries=2", "--disable-pip-version-check",
    "--no-deps", "--require-hashes", "--only-binary=:all:",
)  # fmt: skip
BEGUN = "Installing collected packages"
"""What pip says once it changes the environment."""
PARTS = {
    "dev": "pytest, ruff and mypy, about 130 MB",
    "can": "python-can, about 3 MB",
    "fleet": "Dask, Parquet and DuckDB, about 280 MB",
    "export": "MuJoCo and FMPy, about 230 MB",
}
"""By name in requirements/: what it brings."""


class InstallError(Exception):
    """An environment that cannot be made; the message is the one line for the user."""


def main(arguments: Sequence[str]) -> int:
    """Make the environment, then start ./rsea again with the user's arguments."""
    root, ros, key, parts = Path(arguments[0]), arguments[1], arguments[2], arguments[3].split()
    try:
        ensure(root, ros if ros == "sourced" else wheels(platform.machine(), libc()), key, parts)
    except KeyboardInterrupt:
        say("interrupted: the next call goes on with .venv, or makes it anew")
        return 130
    except InstallError as error:
        say(str(error))
        return 2
    except OSError as error:
        say(f"{error.filename}: {error.strerror}")
        return 2
    launcher = str(root / "rsea")
    os.execv(launcher, [launcher, *arguments[4:]])


def libc() -> str:
    """Return the C library, such as "glibc 2.36", or "" where it is not glibc."""
    try:
        return os.confstr("CS_GNU_LIBC_VERSION") or ""
    except (ValueError, OSError):
        return ""


def wheels(machine: str, libc: str) -> str:
    """Return where nodes come from without a sourced ROS 2: wheels or none.

    Raises InstallError for a machine for which the packages that compile have no wheels either.
    """
    if not libc.startswith("glibc "):
        raise InstallError("no glibc here (musl?), expected 2.28 or later: numba has no wheels without it")
    if tuple(map(int, libc.split()[1].split(".")[:2])) < (2, 28):
        raise InstallError(f"{libc}, expected 2.28 or later: the wheels are built for it")
    if machine not in ("x86_64", "aarch64"):
        raise InstallError(f"{machine}: no wheels for it, expected x86_64, or aarch64 without nodes")
    return "wheels" if machine == "x86_64" else "none"


def ensure(root: Path, ros: str, key: str, parts: Sequence[str]) -> None:
    """Make root/.venv with some parts, unless a process that was waited for has made them meanwhile."""
    with exclusive(root / ".venv.lock") as lock:
        if stamp(root / ".venv") != (key, ros):
            make(root, ros, key, lock)
        for part in parts:
            if not same(root / "requirements" / f"{part}.lock", root / ".venv" / f"complete-{part}"):
                add(root, part, lock)


def stamp(venv: Path) -> tuple[str, ...]:
    """Return key and source of ROS 2 of the complete environment, or nothing."""
    try:
        return tuple((venv / "complete").read_text(encoding="utf-8").splitlines())
    except OSError:
        return ()


def same(lock: Path, stamp: Path) -> bool:
    """Return whether a part was installed from this lock."""
    return stamp.is_file() and stamp.read_bytes() == lock.read_bytes()


def make(root: Path, ros: str, key: str, lock: int) -> None:
    """Make the environment from nothing and stamp it."""
    venv = owned(root)
    (venv / "complete").unlink(missing_ok=True)
    size = "0.8 GB" if ros == "wheels" else "0.6 GB"
    say(f"making .venv with Python {platform.python_version()}, this once: about two minutes, about {size}")
    site = ["--system-site-packages"] if ros == "sourced" else []
    run([sys.executable, "-Im", "venv", "--clear", *site, str(venv)], root / ".venv.log", lock)
    names = ["run"]
    if ros == "sourced":
        say(f"rclpy is that of the sourced ROS 2 {os.environ.get('ROS_DISTRO', '')}; installing the rest")
    elif ros == "none":
        say(f"ROS 2 wheels exist for x86_64, this is {platform.machine()}: nodes need a sourced ROS 2")
    else:
        say("no usable ROS 2 is sourced: ROS 2 Kilted is installed with the rest")
        names.append("ros")
    install(root, names, lock)
    write(venv / "complete", f"{key}\n{ros}\n".encode())
    say(".venv is complete")


def add(root: Path, part: str, lock: int) -> None:
    """Add a part and stamp it.

    If it is interrupted while pip changes the environment, the next call makes all of it anew.
    """
    venv = owned(root)
    say(f"adding {part} to .venv, this once: {PARTS[part]}")
    complete, away = venv / "complete", venv / "complete.away"
    complete.replace(away)
    try:
        install(root, [part], lock)
    except BaseException:
        if BEGUN not in (root / ".venv.log").read_text(encoding="utf-8"):
            away.replace(complete)
        raise
    write(venv / f"complete-{part}", (root / "requirements" / f"{part}.lock").read_bytes())
    away.replace(complete)


def owned(root: Path) -> Path:
    """Return root/.venv. Raises InstallError where it is a link: it belongs to another clone."""
    venv = root / ".venv"
    if venv.is_symlink():
        raise InstallError(f"{venv}: a link, made for another lock; expected a folder of its own, or none")
    return venv


def install(root: Path, names: Sequence[str], lock: int) -> None:
    """Install what some locks name. Raises InstallError."""
    files = [option for name in names for option in ("-r", str(root / "requirements" / f"{name}.lock"))]
    run([str(root / ".venv" / "bin" / "python"), *PIP_INSTALL, *files], root / ".venv.log", lock)


def write(path: Path, content: bytes) -> None:
    """Write a stamp at once."""
    part = path.with_name(f"{path.name}.part")
    part.write_bytes(content)
    part.replace(path)


def run(command: Sequence[str], log: Path, lock: int) -> None:
    """Run one step with its output in the log; show the packages on a terminal.

    The step inherits the lock, so that nobody starts anew beside it should this process be killed.
    Raises InstallError with the reason found in the output.
    """
    with log.open("w", encoding="utf-8") as file, subprocess.Popen(
        command, env=clean(os.environ), pass_fds=[lock], text=True, errors="replace",
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as process:
        try:
            for line in process.stdout or ():
                file.write(line)
                show(line)
        except BaseException:
            process.terminate()
            raise
        finally:
            show("")
    if process.returncode:
        raise InstallError(f"{reason(log.read_text(encoding='utf-8'))} (all output: {log})")


def clean(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without what would install elsewhere or look elsewhere for what is installed."""
    drop = (
        "PYTHONPATH", "PYTHONHOME", "PIP_TARGET", "PIP_PREFIX", "PIP_ROOT", "PIP_NO_BINARY", "PIP_CONSTRAINT",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE",
    )  # fmt: skip
    return {name: value for name, value in environment.items() if name not in drop} | {"PIP_USER": "0"}


def reason(output: str) -> str:
    """Return in one line why a step failed."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    if any(sign in line for line in lines for sign in NETWORK_SIGNS):
        return "no network: the package index does not answer; connect and run again"
    errors = [line for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["failed without a word"])[-1]


def show(line: str) -> None:
    """Show which package is at work, in place, on a terminal only."""
    if sys.stderr.isatty():
        word = line.strip().split(" (")[0][:70] if line.startswith(("Collecting", "Installing")) else ""
        if word or not line:
            print(f"\r\033[K{word}", end="", file=sys.stderr, flush=True)


@contextmanager
def exclusive(path: Path) -> Iterator[int]:
    """Hold the lock file and give its descriptor; wait while another process holds it."""
    with path.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("waiting: another rsea is making .venv")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file.fileno()


def say(message: str) -> None:
    """Tell the user; stdout stays free for results."""
    print(f"rsea: {message}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
