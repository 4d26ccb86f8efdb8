"""rsea test: the whole suite of the repository."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path

from rsea_ros.errors import RseaError
from rsea_ros.processes import Stopped

HELP = "run the tests; further arguments go to pytest (paths are relative to the repository)"
EXAMPLE = "rsea test test/cli -x"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take no arguments; all go to pytest."""
    parser.set_defaults(pass_on=[])


def run(args: argparse.Namespace) -> int:
    """Run pytest on the tree with two workers and return its exit status.

    The first worker waits for nodes most of its time; the other one computes at a lower priority.

    Raises Stopped, once pytest has ended, when a signal asks this process to stop.
    """
    root = Path(__file__).resolve().parents[2]
    if not (root / "test" / "conftest.py").is_file():
        raise RseaError(f"{root}: no tests here, expected the repository: run ./rsea test in a clone")
    workers = ["-n", "2", "--dist", "loadfile"] if (os.cpu_count() or 1) > 1 else []
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "pytest", "-q", *workers, *args.pass_on]
    pytest = subprocess.Popen(command, cwd=root, env=environment)
    stopped: KeyboardInterrupt | None = None
    while True:
        try:
            status = pytest.wait()
        except KeyboardInterrupt as stop:
            stopped = stop
            if isinstance(stop, Stopped) and stop.number != signal.SIGINT:  # which the terminal sends it
                pytest.send_signal(signal.SIGINT)
        else:
            if stopped is not None:
                raise stopped
            return status
