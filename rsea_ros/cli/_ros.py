"""Requirements of nodes that the wheel does not install."""

from __future__ import annotations

from importlib.util import find_spec

from rsea_ros.errors import RseaError


def need_ros() -> None:
    """Raise RseaError if rclpy is missing."""
    if find_spec("rclpy") is None:
        raise RseaError("rclpy is missing, expected a sourced ROS 2, or ./rsea in a clone on x86_64")
