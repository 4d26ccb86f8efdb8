"""A node as a separate process."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from rsea_ros import processes

POLL = 0.1
"""s, interval between checks of the running nodes."""
stop = processes.stop


def start(name: str, arguments: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a node by name, with ROS arguments. options: of Popen."""
    return processes.start([sys.executable, "-m", f"rsea_ros.nodes.{name}", *arguments], **options)
