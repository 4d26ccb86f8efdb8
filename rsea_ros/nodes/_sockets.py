"""How a node with torque in hand publishes: by sockets alone, which wait for no listener.

Fast DDS gives messages to listeners on the same machine through shared memory. For one that was stopped
(SIGSTOP, a debugger) while it takes a message out, `publish` waits for a second or two, and rclpy keeps the
interpreter meanwhile: the cycle stands still under torque.
"""

from __future__ import annotations

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
LOCALHOST, AS_PROFILE = "LOCALHOST", "SYSTEM_DEFAULT"
"""Of RANGE: with the first rmw_fastrtps adds shared memory whatever else is said, with the second nothing."""
PROFILE = "FASTDDS_DEFAULT_PROFILES_FILE"
USERS = (PROFILE, "FASTRTPS_DEFAULT_PROFILES_FILE")
OLDER = ("humble", "iron")
"""Distributions whose Fast DDS does not read PROFILE: it would be open to the network."""
FILE = Path(__file__).with_name("localhost_sockets.xml")
"""Who may find the node is the same: this machine."""


def publish_by_sockets() -> None:
    """Do so from the next participant on, unless the user has a profile of Fast DDS, or other middleware."""
    if any(name in os.environ for name in USERS) or os.environ.get("ROS_DISTRO") in OLDER:
        return
    if not get_rmw_implementation_identifier().startswith("rmw_fastrtps"):
        return
    if os.environ.get(RANGE) == LOCALHOST and PEERS not in os.environ and FILE.is_file():
        os.environ[RANGE] = AS_PROFILE
        os.environ[PROFILE] = str(FILE)
    else:
        os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
