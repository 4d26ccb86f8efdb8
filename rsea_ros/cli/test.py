"""rsea test: the suite of the repository, whole or a group of it."""

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path

from rsea_ros.errors import RseaError
from rsea_ros.processes import Stopped

HELP = "run the tests: all, science, safety or contract; further arguments go to pytest"
EXAMPLE = "rsea test safety -x"

MOST = 8
"""Workers that compute: collecting the tests costs each some seconds."""

GROUPS = {
    "science": (
        "test/checks", "test/control", "test/design", "test/diagnosis", "test/effects", "test/experiment",
        "test/health", "test/identification", "test/independent", "test/laws", "test/model", "test/paper",
        "test/extras/trends",
    ),
    "safety": (
        "test/hardware", "test/nodes", "test/extras/nodes", "test/cli/test_run_launch_topics.py",
        "test/test_stamps.py", "test/test_held_commands.py", "test/cli/test_ctrl_c.py",
    ),
    "contract": ("test/golden", "test/cli", "test/library", "test/msg_adapters", "test/test_imports.py"),
    "all": (),
}  # fmt: skip
"""What each group runs: physics and statistics; what keeps torque off; what other programs rely on.

A tree without the extras lacks their folders."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Take a group; all other arguments go to pytest."""
    parser.add_argument("--renew", action="store_true", help="write the stored outputs of test/golden anew")
    parser.set_defaults(pass_on=[])


def run(args: argparse.Namespace) -> int:
    """Run pytest on a group or some paths with a worker more than cores and return its exit status.

    The first worker waits for nodes most of its time; the others compute at a lower priority.

    Raises Stopped, once pytest has ended, when a signal asks this process to stop.
    """
    root = Path(__file__).resolve().parents[2]
    if not (root / "test" / "conftest.py").is_file():
        raise RseaError(f"{root}: no tests here, expected the repository: run ./rsea test in a clone")
    cores = min(os.cpu_count() or 1, MOST)
    workers = ["-n", str(cores + 1), "--dist", "loadfile"] if cores > 1 else []
    groups = {name: [path for path in paths if (root / path).exists()] for name, paths in GROUPS.items()}
    chosen = [path for word in args.pass_on for path in groups.get(word, [word])]
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    if args.renew:
        environment["RSEA_RENEW"] = "1"
        chosen.append("test/golden")
    command = [sys.executable, "-m", "pytest", "-q", *workers, *chosen]
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
