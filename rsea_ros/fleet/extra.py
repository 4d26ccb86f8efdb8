"""Packages of the extra `fleet`, checked before any work."""

from __future__ import annotations

from importlib.util import find_spec

from rsea_ros.fleet.fleet_error import FleetError

PACKAGES = ("pyarrow", "duckdb", "fsspec", "dask", "distributed")


def need_extra() -> None:
    """Raise FleetError where a package of the extra `fleet` is not installed."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        install = "pip install 'rsea_ros[fleet]'"
        raise FleetError(f"{', '.join(missing)}: not installed, expected for rsea fleet: {install}")
