"""One thread for linear algebra: the matrices here are small, and the program's own threads use the cores."""

from __future__ import annotations

from contextlib import AbstractContextManager

from threadpoolctl import threadpool_limits


def one_blas_thread() -> AbstractContextManager[object]:
    """Keep BLAS from starting threads inside a with statement; else a fit takes four times as long."""
    return threadpool_limits(1, user_api="blas")
