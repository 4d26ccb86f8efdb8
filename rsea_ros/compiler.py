"""numba's compiler, keeping what it makes in this package's cache (compiler_cache.py).

The folder is named only while a function of this package is decorated: neither the environment nor numba's
settings for the functions of others change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numba
from numba.core import config as numba_config

from rsea_ros.compiler_cache import cache_folder


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a compiled function, with its options."""
    return _keeping(numba.njit(**options))


def cfunc(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a function with an address that compiled code can call."""
    return _keeping(numba.cfunc(signature, **options))


def _keeping(decorator: Callable[..., Any]) -> Callable[[Callable[..., Any]], Any]:
    def decorate(function: Callable[..., Any]) -> Any:
        with _own_cache():
            return decorator(function)

    return decorate


@contextmanager
def _own_cache() -> Iterator[None]:
    """Let numba keep code in the package's folder, unless the user has named one (NUMBA_CACHE_DIR)."""
    settings: Any = numba_config
    users = settings.CACHE_DIR
    settings.CACHE_DIR = users or _folder()
    try:
        yield
    finally:
        settings.CACHE_DIR = users


@lru_cache(maxsize=1)
def _folder() -> str:
    return str(cache_folder())
