"""Shared by all tests: the worker, a ROS domain for each worker, and reproducible examples."""

from __future__ import annotations

import fcntl
import functools
import gc
import os
import platform
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest
from hypothesis.internal.conjecture import providers
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

if platform.machine() == "x86_64":  # stored numbers are one kernel's: fits far from a truth show rounding
    os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

import rsea_ros.cli  # noqa: F401  first of all: it keeps numpy from starting threads of its own
from rsea_ros.compiler import trusted_cache

gc.disable()  # until all is collected: it finds nothing in what tests are made of, in a second of each worker

if sys.dont_write_bytecode:  # pytest would rewrite 3000 asserts in each worker, 10 s, and programs compile
    sys.dont_write_bytecode, sys.pycache_prefix = False, str(trusted_cache("bytecode"))
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

hypothesis.settings.register_profile("rsea", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("rsea")
# Else examples have numbers of the modules that a worker happens to have loaded, and each parses all of them.
providers._get_local_constants = providers.Constants


def _take_domain() -> int:
    """Take a ROS domain that no other worker or test run on this machine has, until this process ends."""
    for domain in range(1, 102):  # above 101 the ports of DDS run into the ephemeral ones
        path = Path(tempfile.gettempdir()) / f"rsea-test-domain-{os.getuid()}-{domain}"
        lock = os.open(path, os.O_CREAT | os.O_RDWR, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain
        except BlockingIOError:
            os.close(lock)
    raise RuntimeError("no free ROS domain between 1 and 101: other test runs hold all of them")


FIRST = "gw0"
"""The worker that keeps its priority, and gets the files that wait: the others make way for it."""

if (worker := os.environ.get("PYTEST_XDIST_WORKER")) is not None:
    from rsea_ros.identification.solver import on_cores  # 0.5 s; their controller needs none

    on_cores(1).__enter__()  # there is a worker for each core: threads that wait for each other cost a fifth
    os.nice(0 if worker == FIRST else 10)

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(_take_domain())

# A background job of a shell ignores SIGINT, one under nohup SIGHUP, and so would every program that a test
# starts and interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

WAITING = (
    "cli/test_demo", "nodes/", "extras/nodes/", "hardware/test_faults", "hardware/test_lost_torque",
    "hardware/test_protection", "hardware/test_frames", "hardware/test_netft", "hardware/test_line",
    "hardware/test_same_motor", "hardware/test_series", "hardware/test_mit_motor",
)  # fmt: skip
"""Files that clocks of nodes and wires judge: the first worker alone takes them, one after the other."""

NODELESS = tuple(
    f"nodes/test_{name}.py" for name in (
        "controller_link", "controller_steps", "devices", "drive", "experiment_parts", "identify_parts",
        "orders", "player",
    )
)  # fmt: skip
"""Files of nodes/ that start none, and whose clocks are their own: any worker takes them."""

PATIENT = (
    "cli/test_run_launch_topics", "nodes/test_identify_diagnosis", "nodes/test_parameters",
    "nodes/test_policies", "nodes/test_processes", "extras/watch/test_page", "extras/watch/test_server",
    "cli/test_bench", "cli/test_ctrl_c", "msg_adapters/test_cdr",
)  # fmt: skip
"""Files that wait for processes and are late for nothing: any worker takes them, at the end."""

COMPUTING = (
    "golden/", "diagnosis/test_hidden_effects", "test_realdata", "test_launcher", "health/test_monitor",
    "checks/test_dead", "experiment/", "checks/test_clocks", "checks/test_gains", "laws/test_hidden_laws",
    "report/", "extras/pages/", "effects/", "diagnosis/test_known_values", "control/test_controller",
    "test_docs",
)  # fmt: skip
"""Files that compute longest, in this order, so that no worker is left with one of them at the end."""


TOGETHER = {
    "test/report": ("test/report/", "test/extras/pages/test_in_browser"),
    "test/test_house": ("test/test_house", "test/test_imports", "test/test_fault_", "test/test_compiler_"),
}
"""Files that one worker takes as one: what the first makes, or reads of every source, the others need."""


@functools.cache  # asked of every file after every test
def _place(nodeid: str) -> int:
    """Return where a test's file stands in the order of the files."""
    fits = lambda name: nodeid.startswith(f"test/{name}")  # noqa: E731
    places = (k for k, name in enumerate(WAITING + COMPUTING) if fits(name))
    last = len(WAITING + COMPUTING)
    return last + 1 if any(map(fits, PATIENT)) else last if any(map(fits, NODELESS)) else next(places, last)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the slowest files first, the patient ones last, and leave the others in their order."""
    places = {item.path: _place(item.nodeid) for item in items}
    items.sort(key=lambda item: places[item.path])


class OneWorker(LoadFileScheduling):
    """Give a worker whole files: the first one those that wait, the others those that compute.

    Two nodes under test at a time, or one beside a computation of its own priority, are late and fail.
    """

    def _split_scope(self, nodeid: str) -> str:
        whole = next((place for place, files in TOGETHER.items() if nodeid.startswith(files)), None)
        return whole or super()._split_scope(nodeid)

    def _next_of(self, node: WorkerController) -> str | None:
        """Return the file that a worker takes next: the longest computation, or what only the first may take.

        By the worker's name: the first to report may be any of them, and one that makes way would be late.
        """
        waits = [scope for scope in self.workqueue if _place(scope) < len(WAITING)]
        others = [scope for scope in self.workqueue if _place(scope) >= len(WAITING)]
        if node.gateway.id == FIRST:
            return next(iter([*waits, *reversed(others)]), None)
        is_first_gone = all(other.gateway.id != FIRST for other in self.nodes)
        return next(iter([*others, *waits * is_first_gone]), None)

    def _assign_work_unit(self, node: WorkerController) -> None:
        if (scope := self._next_of(node)) is not None:
            self.workqueue.move_to_end(scope, last=False)
            super()._assign_work_unit(node)

    def _reschedule(self, node: WorkerController) -> None:
        """Give a worker another file before it is through, or let it end where none is left for it."""
        if self._pending_of(self.assigned_work[node]) > 2:  # tests, as the base counts: asked after each
            return
        if self._next_of(node) is not None:
            super()._reschedule(node)
        elif not node.shutting_down:
            node.shutdown()


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> OneWorker | None:
    """Hand the files out in the order of the collection, not by their number of tests."""
    if config.option.dist != "loadfile":
        return None
    config.option.loadscopereorder = False
    return OneWorker(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Turn a skip into a failure where CI is set: there everything must run."""
    report = yield
    if report.skipped and os.environ.get("CI") and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped, and in CI nothing is: {report.longrepr[-1]}"
    return report


def pytest_collection_finish() -> None:
    """Leave what now exists in memory.

    Else the collector of garbage looks through all modules and items again and again, 4 % of the time.
    """
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)
    gc.enable()
