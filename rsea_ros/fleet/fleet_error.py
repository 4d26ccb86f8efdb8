"""Errors of a fleet, and the extra that it needs."""

from __future__ import annotations

from importlib.util import find_spec

from rsea_ros.errors import FieldError, RseaError


class FleetError(RseaError, ValueError):
    """A source, a store or a cluster that cannot be used."""


class JointMapError(FieldError):
    """A joint map with a missing, unknown or impossible value."""


PACKAGES = ("pyarrow", "duckdb", "fsspec", "dask", "distributed")


def need_extra() -> None:
    """Raise FleetError where a package of the extra `fleet` is not installed."""
    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        install = "pip install 'rsea_ros[fleet]'"
        raise FleetError(f"{', '.join(missing)}: not installed, expected for rsea fleet: {install}")
