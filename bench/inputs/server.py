"""A fork server: this process has run every verb once and forks once for each piece of work."""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from bench.inputs.outcome import Outcome, call, outcome_of_end
from rsea_ros.effects.catalogue import catalogue

RIG = "paper_high_impedance"
WALL = 1200
"""s after which a child that neither computes nor ends is ended."""
MODULES = (
    "rsea_ros.cli.identify", "rsea_ros.cli.diagnose", "rsea_ros.cli.predict", "rsea_ros.cli.simulate",
    "rsea_ros.cli.control", "rsea_ros.cli.design", "rsea_ros.cli.export", "rsea_ros.cli.import_",
    "rsea_ros.cli.check", "rsea_ros.report.diagnosis.page", "rsea_ros.report.identification",
    "rsea_ros.report.control", "rsea_ros.report.design", "rsea_ros.design.mujoco_model",
    "msg_adapters.records", "scipy.interpolate", "scipy.signal", "scipy.io", "rich.console", "rich.table",
)  # fmt: skip
FIRST = (
    ["simulate", RIG, "--out", "DIR/bag.mcap", "--duration", "5"],
    ["check", "DIR/bag.mcap", "--rig", RIG],
    ["identify", "DIR/bag.mcap", "--rig", RIG, "--out", "DIR/identified"],
    ["diagnose", "DIR/bag.mcap", "--rig", RIG, "--out", "DIR/diagnosed"],
    ["predict", RIG, "DIR/bag.mcap", "--out", "DIR/predicted.csv", "--json"],
    ["design", "--out", "DIR/design"],
)  # fmt: skip
"""Verbs that are run once before all others."""

Work = Callable[[Path], Iterator[tuple[str, Callable[[], Outcome]]]]
"""In a folder of its own: yields names, and what gives the outcome of each."""


def warm() -> None:
    """Import all modules of the verbs and run the verbs, so that no child has to load code."""
    for name in MODULES:
        importlib.import_module(name)
    catalogue()
    with tempfile.TemporaryDirectory(prefix="rsea-warm-") as folder:
        for words in FIRST:
            call([word.replace("DIR", folder) for word in words])


def serve(works: Iterable[Work], folder: Path, jobs: int) -> Iterator[tuple[str, Outcome]]:
    """Do the works in at most `jobs` children at a time; yield name and outcome of each part as they end."""
    running: dict[int, Path] = {}
    for number, work in enumerate(works):
        if len(running) >= jobs:
            yield from _end(running)
        inside = folder / str(number)
        inside.mkdir()
        running[_fork(work, inside)] = inside
    while running:
        yield from _end(running)


def _fork(work: Work, inside: Path) -> int:
    """Start a child that writes each name and then its outcome to a file; return its process id."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid:
        return pid
    status = 70
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.alarm(WALL)
        with (inside / "log").open("w", encoding="utf-8", buffering=1) as file:
            for name, part in work(inside):
                file.write(json.dumps(name) + "\n")
                file.write(json.dumps(asdict(_judged(part))) + "\n")
        status = 0
    finally:
        os._exit(status)


def _judged(part: Callable[[], Outcome]) -> Outcome:
    """Return the outcome of a part; an error of the bench's own is one too."""
    began = time.process_time()
    try:
        outcome = part()
    except Exception:
        text = traceback.format_exc()
        outcome = Outcome("gate", text.splitlines()[-1], text[-3000:])
    outcome.seconds = time.process_time() - began
    outcome.megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return outcome


def _end(running: dict[int, Path]) -> Iterator[tuple[str, Outcome]]:
    """Wait until a child ends, and yield what it has left; the part at which it broke off has its end."""
    pid, status, usage = os.wait4(-1, 0)
    lines = [json.loads(line) for line in (running.pop(pid) / "log").read_text("utf-8").splitlines()]
    for name, outcome in zip(lines[::2], lines[1::2], strict=False):
        yield name, Outcome(**outcome)
    if status:
        yield lines[-1] if len(lines) % 2 else "the bench itself", outcome_of_end(status, usage)
