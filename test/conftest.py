"""What every test shares: a ROS domain of its own for each worker, and reproducible examples."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

import hypothesis

hypothesis.settings.register_profile("rsea", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("rsea")


def _own_domain() -> IO[str]:
    """Take a ROS domain that no other worker or test run on this machine has; held while the file is open."""
    for domain in range(1, 102):  # above 101 DDS ports run into the ephemeral ones
        lock = (Path(tempfile.gettempdir()) / f"rsea-test-domain-{os.getuid()}-{domain}").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        return lock
    raise RuntimeError("no free ROS domain between 1 and 101: other test runs hold all of them")


os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
DOMAIN_LOCK = _own_domain()
