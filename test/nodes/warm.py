"""Start nodes in their own processes, forked from one that has imported the numerics: 0.7 s of CPU less each.

The parent reads requests as lines of JSON: it forks, and the fork becomes the node. The parent has one thread
and does not import ROS, which starts threads. It writes the exit status of each node into a file.
"""

from __future__ import annotations

import atexit
import importlib
import json
import os
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).resolve().parents[2]
MODULES = (
    "rsea_ros.nodes", "rsea_ros.hardware.simulated", "rsea_ros.hardware.dynamixel_netft",
    "rsea_ros.hardware.guarded", "rsea_ros.model.observer", "rsea_ros.model.torque_band",
    "rsea_ros.control.controller", "rsea_ros.identification.identify", "rsea_ros.health.monitor",
    "rsea_ros.experiment.campaign", "msg_adapters",
)  # fmt: skip
"""What most of a node's time to import goes to."""


class Nodes:
    """The parent, as a test sees it. folder: where the ends of nodes are written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._parent = subprocess.Popen(
            [sys.executable, __file__, str(folder)], env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def start(self, name: str, words: list[str], environment: dict[str, str], log: Path) -> Node:
        """Start a node with words on its command line, whose output goes into a file."""
        wish = {"name": name, "words": words, "environment": environment, "log": str(log)}
        print(json.dumps(wish), file=self._parent.stdin, flush=True)
        pid = int(self._parent.stdout.readline())
        return Node(pid, self._folder / str(pid))

    def close(self) -> None:
        """End the parent, which kills the nodes that still run."""
        self._parent.communicate()


class Node:
    """A node that was started. end: the file into which its status is written."""

    def __init__(self, pid: int, end: Path) -> None:
        self.pid, self._end = pid, end

    def poll(self) -> int | None:
        """Return its status, negative for a signal, or None while it runs."""
        return int(self._end.read_text()) if self._end.exists() else None

    def wait(self, seconds: float = 60.0) -> int:
        """Wait for its end and return its status. Raises TimeoutExpired."""
        deadline = time.monotonic() + seconds
        while (status := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f"node {self.pid}", seconds)
            time.sleep(0.01)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it without asking."""
        self.send_signal(signal.SIGKILL)


def serve(folder: Path) -> None:
    """Be the parent until nobody asks any more."""
    prepare()
    running: set[int] = set()

    def reap(number: int, frame: FrameType | None) -> None:
        for pid in sorted(running):
            if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
                _, status = os.waitpid(pid, 0)
                running.remove(pid)
                (folder / f"{pid}.new").write_text(str(os.waitstatus_to_exitcode(status)))
                (folder / f"{pid}.new").rename(folder / str(pid))

    signal.signal(signal.SIGCHLD, reap)
    for line in sys.stdin:
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGCHLD])
        pid = os.fork()
        if pid == 0:
            become(**json.loads(line))
        (folder / str(pid)).unlink(missing_ok=True)
        running.add(pid)
        sys.stdout.write(f"{pid}\n")
        sys.stdout.flush()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGCHLD])
    for pid in running:
        os.kill(pid, signal.SIGKILL)


def prepare() -> None:
    """Import what nodes need but ROS, and load the compiled code by the design of a run (0.5 s of CPU)."""
    for module in MODULES:
        importlib.import_module(module)
    import numpy as np  # after rsea_ros.nodes, which keeps it from starting threads

    from rsea_ros.experiment.campaign import Campaign
    from rsea_ros.experiment.proposal import DesignRequest
    from rsea_ros.experiment.run_shape import RunLimits
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.model.simulation import synthesize
    from rsea_ros.records.record import Channel

    rig, asked = load_rig("paper_high_impedance"), DesignRequest(RunLimits(torque=8.0), longest=0.5)
    t = np.arange(280) / 280.0
    record = synthesize(rig, Channel(t, np.sin(t)))
    Campaign(rig, ["current_loop_lag"], asked, lambda proposal: None).go([record])
    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, f"{threads} threads, of which a fork has one"


def become(name: str, words: list[str], environment: dict[str, str], log: str) -> None:
    """Be a node, in a fork, as `python -m` would; this does not return."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGCHLD])
    for path, flags, files in ((os.devnull, os.O_RDONLY, (0,)), (log, os.O_WRONLY | os.O_APPEND, (1, 2))):
        opened = os.open(path, flags)
        for file in files:
            os.dup2(opened, file)
        os.close(opened)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [name, "--ros-args", *words]
    status = 1
    try:
        status = importlib.import_module(f"rsea_ros.nodes.{name}").main()
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
