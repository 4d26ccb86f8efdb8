"""What benches of nodes share: nodes in processes, their ROS domain, priorities and processor time."""

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bench import ROOT
from rsea_ros.cli._processes import parameter_words

NOTES = "RSEA_BENCH_TIMES"
"""Environment variable: the file in which a node of bench leaves the times of its work."""


def own_domain() -> None:
    """Keep this process and those that it starts to a ROS domain of their own, on this machine."""
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def cpu_time(pid: int) -> float:
    """Return the processor time that a process has used so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def may_have(priority: int) -> bool:
    """Return whether this process may have a priority of SCHED_FIFO, or needs none (0)."""
    if priority == 0:
        return True
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


@contextmanager
def run_node(
    name: str, *, priority: int = 0, folder: Path | None = None, noted: bool = False, **parameters: object
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node in a process of its own; SIGINT ends it.

    priority: of SCHED_FIFO for all of it, 0: none. folder: for its log. noted: and for its times, NAME.npy.
    """
    program = [str(ROOT / "bench" / "noted.py"), name] if noted else ["-m", f"rsea_ros.nodes.{name}"]
    environment, log = {**os.environ, "PYTHONPATH": str(ROOT)}, Path(os.devnull)
    if folder is not None:
        environment |= {"ROS_LOG_DIR": str(folder), NOTES: str(folder / f"{name}.npy")}
        log = folder / f"{name}.log"
    with log.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, *program, "--ros-args", *parameter_words(parameters)], cwd=ROOT,
            env=environment, stdin=subprocess.DEVNULL, stdout=file, stderr=file,
        )  # fmt: skip
    if priority:
        os.sched_setscheduler(process.pid, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(20)
        finally:
            process.kill()


@contextmanager
def hurried_wire(priority: int) -> Iterator[None]:
    """Let the kernel's workers that carry the bytes of a pseudo-terminal run at SCHED_FIFO within the block.

    They are the wire, which no process can hold up. At normal priority beside processes that compute, a
    worker waits for tens to hundreds of ms, and so does whoever polls the terminal: Linux lets a poll of a
    terminal wait for its worker (tty_buffer_flush_work in n_tty_poll). Above the nodes, workers of the disk
    would delay them. priority: 0, or one that is not permitted: as before.
    """
    workers = _workers() if priority else []
    try:
        for worker in workers:
            _schedule(worker, os.SCHED_FIFO, priority)
        yield
    finally:
        for worker in workers:
            _schedule(worker, os.SCHED_OTHER, 0)


def _schedule(worker: int, policy: int, priority: int) -> None:
    with suppress(PermissionError, ProcessLookupError):
        os.sched_setscheduler(worker, policy, os.sched_param(priority))


def _workers() -> list[int]:
    """Return the threads of the kernel's workers that are bound to no processor."""
    names = {}
    for place in Path("/proc").glob("[0-9]*/comm"):
        with suppress(OSError):  # it has ended meanwhile
            names[int(place.parent.name)] = place.read_text()
    return [number for number, name in names.items() if name.startswith("kworker/u")]
