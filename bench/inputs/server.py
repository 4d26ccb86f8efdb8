"""A fork server: this process has run every verb once and forks once for each piece of work."""

from __future__ import annotations

import importlib
import os
import resource
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from bench.inputs.outcome import Outcome, call, collect, fork
from rsea_ros.effects.catalogue import catalogue

RIG = "paper_high_impedance"
WALL = 600.0
"""s, after which a child that does not even compute is ended."""
MODULES = (
    "rsea_ros.cli.identify", "rsea_ros.cli.diagnose", "rsea_ros.cli.predict", "rsea_ros.cli.simulate",
    "rsea_ros.cli.control", "rsea_ros.cli.design", "rsea_ros.cli.export", "rsea_ros.cli.import_",
    "rsea_ros.cli.check", "rsea_ros.checks.check", "rsea_ros.report.check",
    "rsea_ros.identification.identify", "rsea_ros.diagnosis.diagnose",
    "rsea_ros.report.diagnosis.files", "rsea_ros.report.identification.page",
    "rsea_ros.report.diagnosis.terminal",
    "rsea_ros.report.control.page", "rsea_ros.report.design.page", "rsea_ros.control.study",
    "rsea_ros.design.spring_design", "rsea_ros.design.mujoco_model", "msg_adapters.records",
    "msg_adapters.records",
    "scipy.interpolate", "scipy.signal", "scipy.io", "rich.console", "rich.table",
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

Work = tuple[str, Callable[[Path], Outcome]]
"""A name, and the work to do in its own folder."""


def warm() -> None:
    """Import all modules of the verbs and run the verbs, so that no child has to load code."""
    for name in MODULES:
        importlib.import_module(name)
    catalogue()
    with tempfile.TemporaryDirectory(prefix="rsea-warm-") as folder:
        for words in FIRST:
            call([word.replace("DIR", folder) for word in words])


def serve(work: Iterable[Work], folder: Path, jobs: int, wall: float = WALL) -> Iterator[tuple[str, Outcome]]:
    """Do the work in at most `jobs` children at a time; yield name and outcome as they end."""
    running: dict[int, tuple[str, Path, float]] = {}
    for number, (name, one) in enumerate(work):
        while len(running) >= jobs:
            yield from _end(running, wall)
        inside = folder / str(number)
        inside.mkdir()
        pid = fork(lambda one=one, inside=inside: one(inside), folder / f"{number}.json")
        running[pid] = (name, folder / f"{number}.json", time.monotonic())
    while running:
        yield from _end(running, wall)


def _end(running: dict[int, tuple[str, Path, float]], wall: float) -> Iterator[tuple[str, Outcome]]:
    """Wait until at least one child ends, or a late one is ended."""
    while True:
        for pid, (name, answer, since) in list(running.items()):
            late = time.monotonic() - since > wall
            if late:
                os.kill(pid, signal.SIGKILL)
            done, status, usage = _wait(pid, block=late)
            if done:
                del running[pid]
                shutil.rmtree(answer.with_suffix(""), ignore_errors=True)
                yield name, collect(status, usage, answer, late)
                return
        time.sleep(0.01)


def _wait(pid: int, block: bool) -> tuple[int, int, resource.struct_rusage]:
    return os.wait4(pid, 0 if block else os.WNOHANG)
