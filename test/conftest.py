"""What every test shares: a ROS domain of its own for each worker, and reproducible examples."""

from __future__ import annotations

import fcntl
import os
import signal
import tempfile
from pathlib import Path

import hypothesis

import rsea_ros  # noqa: F401  first of all: it keeps numpy from starting threads of its own

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

# A background job of a shell ignores SIGINT, and so would every program that a test starts and interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
