"""Packages of the extra `fleet`, imported when they are needed."""

from __future__ import annotations

import importlib
from typing import Any

from rsea_ros.fleet.errors import FleetError


def extra(name: str) -> Any:
    """Return a module of the extra `fleet`. Raises FleetError in one line where it is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        package = (error.name or name).split(".")[0]
        raise FleetError(
            f"{package} is not installed, expected it for rsea fleet: pip install 'rsea_ros[fleet]'"
        ) from None
