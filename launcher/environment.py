"""Make .venv from the pinned lock; ./rsea calls `environment.py ROOT wheels|sourced KEY [ARGUMENT…]`.

Standard library only. The stamp `.venv/complete` (the key, and where ROS 2 comes from) is written last and by
rename: an environment without it is never used, whatever interrupted its making.
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
PIP_INSTALL = ("-m", "pip", "install", "--no-input", "--progress-bar=off", "--retries=2")


class InstallError(Exception):
    """An environment that cannot be made; the message is the one line for the user."""


def main(arguments: Sequence[str]) -> int:
    """Make the environment, then start ./rsea again with the user's arguments."""
    root, ros, key = Path(arguments[0]), arguments[1], arguments[2]
    try:
        ensure(root, ros, key)
    except KeyboardInterrupt:
        say("interrupted: .venv is not complete, the next call makes it anew")
        return 130
    except InstallError as error:
        say(str(error))
        return 2
    except OSError as error:
        say(f"{error.filename}: {error.strerror}")
        return 2
    launcher = str(root / "rsea")
    os.execv(launcher, [launcher, *arguments[3:]])


def ensure(root: Path, ros: str, key: str) -> None:
    """Make root/.venv unless a process that was waited for has made it meanwhile."""
    with exclusive(root / ".venv.lock") as lock:
        if stamp(root) != (key, ros):
            make(root, ros, key, lock)


def stamp(root: Path) -> tuple[str, ...]:
    """Return key and source of ROS 2 of the complete environment, or nothing."""
    try:
        return tuple((root / ".venv" / "complete").read_text(encoding="utf-8").splitlines())
    except OSError:
        return ()


def make(root: Path, ros: str, key: str, lock: int) -> None:
    """Make the environment from nothing and stamp it."""
    venv = root / ".venv"
    if venv.is_symlink():
        raise InstallError(f"{venv}: a link, made for another lock; expected a folder of its own, or none")
    (venv / "complete").unlink(missing_ok=True)
    say(f"making .venv with Python {platform.python_version()}, this once: about two minutes, about 1.6 GB")
    site = ["--system-site-packages"] if ros == "sourced" else []
    run([sys.executable, "-m", "venv", "--clear", *site, str(venv)], root / ".venv.log", lock)
    locks = [root / "requirements.lock"]
    if ros == "sourced":
        say(f"rclpy is that of the sourced ROS 2 {os.environ.get('ROS_DISTRO', '')}; installing the rest")
    else:
        say("no usable ROS 2 is sourced: ROS 2 Kilted is installed with the rest")
        locks.append(root / "requirements-ros.lock")
    options = [option for path in locks for option in ("-r", str(path))]
    run([str(venv / "bin" / "python"), *PIP_INSTALL, *options], root / ".venv.log", lock)
    part = venv / "complete.part"
    part.write_text(f"{key}\n{ros}\n", encoding="utf-8")
    part.replace(venv / "complete")
    say(".venv is complete")


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
    drop = ("PYTHONPATH", "PYTHONHOME", "PIP_TARGET", "PIP_PREFIX", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
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
