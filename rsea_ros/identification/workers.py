"""Pools: fits side by side, and the derivatives within each, on two cores.

Two pools, for a fit waits for its derivatives: a single pool full of fits would wait for itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

from rsea_ros.identification.solver import Map, in_pool
from rsea_ros.identification.threads import one_blas_thread

_CORES = 2


@dataclass(frozen=True)
class Pools:
    """Where fits run, and how one makes its derivatives."""

    fits: Executor
    run: Map


@contextmanager
def worker_pools() -> Iterator[Pools]:
    """Hold both pools within a with statement; linear algebra keeps to one thread meanwhile."""
    with one_blas_thread(), ThreadPoolExecutor(_CORES) as fits, ThreadPoolExecutor(_CORES) as derivatives:
        yield Pools(fits, in_pool(derivatives))
