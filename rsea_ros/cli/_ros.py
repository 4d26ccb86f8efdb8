"""What nodes need and a wheel alone does not bring."""

from __future__ import annotations

from importlib.util import find_spec

from rsea_ros.errors import RseaError


def need_ros() -> None:
    """Raise RseaError where there is no rclpy."""
    if find_spec("rclpy") is None:
        raise RseaError("no rclpy here: nodes run by ./rsea in a clone, or beside a sourced ROS 2")
