"""A fleet over months: many bags of many joints become rows of one Parquet store, on Dask or without it.

`history` and `recordings` read a store as columns; `rsea fleet` is the command line.
Raises FleetError where a package of the extra `fleet` is not installed.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from rsea_ros import RseaError
from rsea_ros.extension.base import FieldError

if TYPE_CHECKING:
    from rsea_extras.fleet.query import history, recordings

__all__ = ["FleetError", "JointMapError", "history", "recordings"]

PACKAGES = ("pyarrow", "duckdb", "fsspec", "dask", "distributed")


class FleetError(RseaError, ValueError):
    """A source, a store or a cluster that cannot be used."""


class JointMapError(FieldError):
    """A joint map with a missing, unknown or impossible value."""


if missing := [name for name in PACKAGES if find_spec(name) is None]:
    install = "pip install 'rsea_ros[fleet]'"
    raise FleetError(f"{', '.join(missing)}: not installed, expected for rsea fleet: {install}")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("rsea_extras.fleet.query"), name)
