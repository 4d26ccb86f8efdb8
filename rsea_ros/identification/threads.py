"""One thread for linear algebra: the matrices here are small, and the program's own threads use the cores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS from starting threads inside a with statement; else a fit takes four times as long."""
    with threadpool_limits(1, user_api="blas"):
        yield
