"""Worker threads, each with one thread for linear algebra.

Two pools, because a fit waits for its derivatives: a single pool full of fits would wait for itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from threadpoolctl import threadpool_limits

from rsea_ros.identification.solver import Map, in_pool


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS from starting threads inside a with statement; else a fit takes four times as long."""
    with threadpool_limits(1, user_api="blas"):
        yield


_CORES: ContextVar[int] = ContextVar("cores", default=2)


def cores() -> int:
    """Return how many cores a fit may use."""
    return _CORES.get()


@contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Set the number of cores for fits within a with statement: 1 where a program runs several at once."""
    token = _CORES.set(count)
    try:
        yield
    finally:
        _CORES.reset(token)


@dataclass(frozen=True)
class Pools:
    """Where fits run, and how one makes its derivatives."""

    fits: Executor
    run: Map


@contextmanager
def worker_pools() -> Iterator[Pools]:
    """Hold both pools within a with statement; linear algebra keeps to one thread meanwhile."""
    with one_blas_thread(), ThreadPoolExecutor(cores()) as fits, ThreadPoolExecutor(cores()) as derivatives:
        yield Pools(fits, in_pool(derivatives))
