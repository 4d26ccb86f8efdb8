"""Shared by all tests: the worker, a ROS domain for each worker, and reproducible examples."""

from __future__ import annotations

import fcntl
import os
import signal
import sys
import tempfile
from pathlib import Path

import hypothesis
import pytest
from xdist.scheduler import LoadFileScheduling

import rsea_ros.cli  # noqa: F401  first of all: it keeps numpy from starting threads of its own
from rsea_ros.compiler_cache import trusted_cache

BYTECODE = sys.dont_write_bytecode, sys.pycache_prefix
if sys.dont_write_bytecode:  # then pytest would rewrite 3000 asserts anew in each worker, 10 s each
    sys.dont_write_bytecode, sys.pycache_prefix = False, str(trusted_cache("bytecode"))

hypothesis.settings.register_profile("rsea", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("rsea")


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


os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_DOMAIN_ID"] = str(_take_domain())

# A background job of a shell ignores SIGINT, one under nohup SIGHUP, and so would every program that a test
# starts and interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

DEAREST = (
    "test_realdata", "cli/test_demo", "diagnosis/test_hidden_effects", "nodes/test_driver_on_wire",
    "diagnosis/test_two_causes", "cli/test_bad_", "model/test_pure_torque", "nodes/test_loop",
    "diagnosis/test_puzzle", "nodes/test_controller_on_wire", "cli/test_nothing_lost", "hardware/test_faults",
    "test_inputs", "nodes/test_experiment_node", "identification/test_identify", "nodes/test_watch",
    "paper/test_moving_output", "nodes/test_driver_honest", "cli/test_paper", "test_launcher",
    "report/", "nodes/test_parameters", "control/test_verb", "nodes/test_several_joints",
    "laws/test_hidden_laws", "nodes/test_identify_diagnosis", "diagnosis/test_detents", "nodes/test_model",
    "cli/test_diagnose", "nodes/test_controller", "cli/test_run_launch_topics", "fleet/test_task",
    "test_package", "test_readme", "library/test_door", "independent/test_bench",
)  # fmt: skip
"""What takes longest, first, so that no worker is left with it at the end; what computes and what waits for
nodes by turns, so that the cores are busy and the nodes are not late."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the slowest files first and leave the others in their order."""

    def place(item: pytest.Item) -> int:
        found = (k for k, name in enumerate(DEAREST) if item.nodeid.startswith(f"test/{name}"))
        return next(found, len(DEAREST))

    items.sort(key=place)


class OneWorker(LoadFileScheduling):
    """Give a worker whole files, and the files that share a diagnosis together."""

    def _split_scope(self, nodeid: str) -> str:
        return "test/report" if nodeid.startswith("test/report/") else super()._split_scope(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> OneWorker | None:
    """Hand the files out in the order of the collection, not by their number of tests."""
    if config.option.dist != "loadfile":
        return None
    config.option.loadscopereorder = False
    return OneWorker(config, log)


def pytest_collection_finish() -> None:
    """Leave the bytecode of what the tests themselves import to the environment again."""
    sys.dont_write_bytecode, sys.pycache_prefix = BYTECODE
