"""A fleet over months: many bags of many joints become rows of one Parquet store, on Dask or without it.

`history` and `recordings` read a store as columns; `rsea fleet` is the command line.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsea_ros.fleet.query import history, recordings

__all__ = ["history", "recordings"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        import importlib

        from rsea_ros.fleet.fleet_error import need_extra

        need_extra()
        return getattr(importlib.import_module("rsea_ros.fleet.query"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
