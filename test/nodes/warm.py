"""Start nodes and benches in their own processes, forked from one that has imported what they need.

Each takes 0.9 s of CPU less. The parent reads requests as lines of JSON: it forks, and the fork becomes the
node or the bench. The parent has one thread, beside two that a tracer of ROS has for itself. It writes the
exit status of each child into a file.
"""

from __future__ import annotations

import atexit
import functools
import importlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from pathlib import Path

from rsea_ros.hardware.peer.remote import RemoteBench

ROOT = Path(__file__).resolve().parents[2]
MODULES = (
    "rsea_ros.hardware.motor_netft",
    "rsea_ros.hardware.guarded", "rsea_ros.model.observer", "rsea_ros.model.torque_band",
    "rsea_ros.control.controller", "rsea_ros.identification.identify", "rsea_ros.health.monitor",
    "rsea_ros.experiment.campaign", "msg_adapters",
)  # fmt: skip
"""What most of a node's time to import goes to."""
FLAGS = os.O_RDONLY, os.O_WRONLY | os.O_APPEND, os.O_WRONLY | os.O_APPEND
"""How a child opens its standard streams."""


class Parent:
    """The parent, as a test sees it. folder: where the ends of its children are written."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp())
        self._parent = subprocess.Popen(
            [sys.executable, __file__, str(self._folder)], env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def start(
        self, module: str, words: list[str], environment: dict[str, str], files: Sequence[Path]
    ) -> Child:
        """Start a module's main, with words on its command line. files: its first standard streams."""
        wish = {"module": module, "words": words, "environment": environment, "files": [*map(str, files)]}
        print(json.dumps(wish), file=self._parent.stdin, flush=True)
        pid = int(self._parent.stdout.readline())
        return Child(pid, self._folder / str(pid))

    def close(self) -> None:
        """End the parent, which kills the children that still run."""
        self._parent.communicate()


@functools.cache
def parent() -> Parent:
    """Return the parent of this process, started on first use and ended with it."""
    made = Parent()
    atexit.register(made.close)
    return made


class Bench(RemoteBench):
    """A bench that is forked; its F/T sensor sends 400 records a second, unless another number is given.

    At the 1000 of `rsea bench` both ends of the wire take a third more of the processor.
    """

    def _begin(self, words: list[str]) -> Child:
        words = [*words[:2], "--ft-rate", "400", *words[2:]]
        folder = Path(tempfile.mkdtemp())
        pipes = folder / "in", folder / "out"
        for pipe in pipes:
            os.mkfifo(pipe)
        child = parent().start("rsea_ros.cli.main", words, dict(os.environ), pipes)
        child.stdin, child.stdout = pipes[0].open("wb"), pipes[1].open("rb")
        shutil.rmtree(folder)
        return child


class Child:
    """What was started, as a subprocess.Popen. end: the file into which its status is written."""

    def __init__(self, pid: int, end: Path) -> None:
        self.pid, self._end = pid, end
        self.stdin = self.stdout = None

    def poll(self) -> int | None:
        """Return its status, negative for a signal, or None while it runs."""
        return int(self._end.read_text()) if self._end.exists() else None

    def wait(self, seconds: float = 60.0) -> int:
        """Wait for its end and return its status. Raises TimeoutExpired."""
        deadline = time.monotonic() + seconds
        while (status := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f"process {self.pid}", seconds)
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
    """Be the parent until nobody asks any more. What only nodes need is loaded for the first of them.

    Ends are heard by descriptors: a signal between the last look for one and the read of a wish is lost.
    """
    load_bench()
    running: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([sys.stdin, *running], [], [])
        for descriptor in running.keys() & set(ready):
            pid, status = os.waitpid(running.pop(descriptor), 0)
            os.close(descriptor)
            (folder / f"{pid}.new").write_text(str(os.waitstatus_to_exitcode(status)))
            (folder / f"{pid}.new").rename(folder / str(pid))
        if sys.stdin not in ready:
            continue
        line = sys.stdin.readline()
        if not line:
            break
        wish = json.loads(line)
        if wish["module"].startswith(("rsea_ros.nodes.", "rsea_extras.watch.", "quick_")):
            prepare()
        pid = os.fork()
        if pid == 0:
            become(**wish)
        (folder / str(pid)).unlink(missing_ok=True)
        running[os.pidfd_open(pid)] = pid
        sys.stdout.write(f"{pid}\n")
        sys.stdout.flush()
    for pid in running.values():
        os.kill(pid, signal.SIGKILL)
    shutil.rmtree(folder)


def load_bench() -> None:
    """Import what benches need, and load the compiled code of a plant."""
    for module in ("rsea_ros.nodes", "rsea_ros.cli.bench", "rsea_ros.cli.main"):
        importlib.import_module(module)
    from rsea_ros.hardware.simulated import SimulatedDevice
    from rsea_ros.model.rig_file import load_rig

    plant = SimulatedDevice(load_rig("paper_high_impedance"), 1000.0)
    plant.open()
    plant.read()


@functools.cache
def prepare() -> None:
    """Import what nodes need, and load the compiled code by the design of a run (0.5 s of CPU)."""
    for module in MODULES:
        importlib.import_module(module)
    import numpy as np  # after rsea_ros.nodes, which keeps it from starting threads

    from rsea_ros.experiment.campaign import Campaign
    from rsea_ros.experiment.proposal import DesignRequest
    from rsea_ros.experiment.run_shape import RunLimits
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.model.simulation import synthesize
    from rsea_ros.plugins import node_modules
    from rsea_ros.records.record import Channel

    rig, asked = load_rig("paper_high_impedance"), DesignRequest(RunLimits(torque=8.0), longest=0.5)
    t = np.arange(280) / 280.0
    record = synthesize(rig, Channel(t, np.sin(t)))
    Campaign(rig, ["current_loop_lag"], asked, lambda proposal: None).go([record])
    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, f"{threads} threads, of which a fork has one"
    for module in node_modules().values():  # with ROS, whose tracer starts two threads that wait for ever
        importlib.import_module(module)
    hurry_reports()


def hurry_reports() -> None:
    """Let nodes say their health five times a second: many tests wait for what it says next."""
    from rclpy.node import Node

    from rsea_ros.nodes._health import Health

    usual = Node.create_timer

    def create_timer(node, period, callback, *rest, **more):
        is_health = isinstance(getattr(callback, "__self__", None), Health)
        return usual(node, 0.2 if is_health else period, callback, *rest, **more)

    Node.create_timer = create_timer


def become(module: str, words: list[str], environment: dict[str, str], files: list[str]) -> None:
    """Be a program, in a fork, as `python -m` would; this does not return."""
    os.setsid()
    for stream, (path, flags) in enumerate(zip(files, FLAGS, strict=False)):
        opened = os.open(path, flags)
        os.dup2(opened, stream)
        os.close(opened)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [module.rpartition(".")[2], *words]
    status = 1
    try:
        status = importlib.import_module(module).main()
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
