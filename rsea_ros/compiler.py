"""numba's compiler with this package's cache (compiler_cache.py).

The folder is named only while a function of this package is decorated: neither the environment nor numba's
settings for other packages change. Without a writable cache every process compiles its functions again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from typing import Any

import numba
from numba.core import caching as numba_caching
from numba.core import ccallback, sigutils
from numba.core import config as numba_config
from numba.core import runtime as numba_runtime

from rsea_ros.compiler_cache import cache_folder

_log = logging.getLogger(__name__)
_caching: Any = numba_caching
_cfunc: Any = ccallback.CFunc
_normalized: Any = sigutils.normalize_signature
_run_time: Any = numba_runtime.rtsys  # type: ignore[attr-defined]


def njit(*, cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a compiled function, with its options. cache: store the compiled code."""

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = numba.njit(**options)(function)
        if cache:
            compiled._cache = _cache_of(function)
        return compiled

    return decorate


def cfunc(signature: Any, *, cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a function with an address that compiled code can call."""

    def decorate(function: Callable[..., Any]) -> Any:
        compiled = _cfunc(function, _normalized(signature), locals={}, options=options)
        if cache:
            compiled._cache = _cache_of(function)
        compiled.compile()
        return compiled

    return decorate


class _Kept(_caching.FunctionCache):  # type: ignore[misc]
    """The compiled code of one function on the disk; an unreadable or unwritable file costs only time.

    Loading starts only numba's run time. The rest, which a compilation needs, takes 0.35 s to import; numba
    imports it when it compiles.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            _run_time.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                code = self._load_overload(sig, target_context)
        except Exception:  # a file that broke off may raise anything
            with suppress(OSError):
                self.flush()
            code = None
        if code is None:
            tell_once()
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            warn_once(error.strerror or str(error))


def _cache_of(function: Callable[..., Any]) -> Any:
    """Return where the code of a function is kept."""
    try:
        with _own_cache():
            return _Kept(function)
    except (OSError, RuntimeError) as error:  # numba's word for a folder that cannot be made
        warn_once(str(error))
        return _caching.NullCache()


@cache
def warn_once(reason: str) -> None:
    """Warn that compiled code is not stored, once for each reason."""
    _log.warning("compiled code is not kept, and is compiled again in every process: %s", reason)


@cache
def tell_once() -> None:
    """Log, once in a process, that code is compiled and stored, which takes time."""
    _log.info("compiling the simulation for this machine: up to a minute, once")


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
