"""What benches of nodes share: a ROS domain of their own, and the processor time of a process."""

from __future__ import annotations

import os
import random
from pathlib import Path


def own_domain() -> None:
    """Keep this process and those that it starts to a ROS domain of their own, on this machine."""
    os.environ["ROS_DOMAIN_ID"] = str(random.randint(60, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def cpu_time(pid: int) -> float:
    """Return the processor time that a process has used so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
