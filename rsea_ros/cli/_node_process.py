"""A node as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from rsea_ros import processes

POLL = 0.1
"""s between looks at whether nodes still run."""
stop = processes.stop


def start(name: str, arguments: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a node by name, with ROS arguments. options: of Popen."""
    return processes.start([sys.executable, "-m", f"rsea_ros.nodes.{name}", *arguments], **options)
