"""Compiled functions (numba), and the folder in which their machine code is kept.

The folder is named only while a function of this package is decorated: neither the environment nor numba's
settings for other packages change. Without a writable cache every process compiles its functions again.

Numba stores machine code beside the source and recompiles it when the file of the function changes. It does
not see that a function of another file was compiled into it, and it cannot write into an installed package.

Code in the folder is executed, so it is used only where nobody but this user (or root) can have written it.
"""

import fcntl
import hashlib
import logging
import os
import stat
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core import (
    caching as numba_caching,
    ccallback,
    config as numba_config,
    runtime as numba_runtime,
    sigutils,
)

SHARED = (
    "effects/_*.py", "effects/effect.py", "effects/signal_table.py", "effects/spring_hysteresis.py",
    "model/drive.py", "model/pure_torque_error.py", "model/step.py",
    "model/observer/filter.py", "model/observer/log.py", "model/observer/transition.py",
)  # fmt: skip
"""Files whose functions and constants are compiled into those of other files."""


def cache_folder() -> Path:
    """Return the folder of the code that is compiled from the present sources."""
    return trusted_cache(shared_key(Path(__file__).parent))


def shared_key(package: Path) -> str:
    """Return a digest of the contents of the shared files of a package."""
    digest = hashlib.blake2b(digest_size=8)
    for pattern in SHARED:
        for file in sorted(package.glob(pattern)):
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def trusted_cache(name: str) -> Path:
    """Return a folder of a name that only this user can enter, made where it is missing.

    The first that can be trusted: in the cache of the home, in that for temporary files, else a fresh one
    that ends with this process.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    if home.is_absolute() and private(home / "rsea_ros") and private(home / "rsea_ros" / name, 0o077):
        return home / "rsea_ros" / name
    import atexit  # imported here: 9 ms that are rarely needed
    import shutil
    import tempfile

    temporary = Path(tempfile.gettempdir()) / f"rsea_ros-{os.geteuid()}"
    if private(temporary) and private(temporary / name, 0o077):
        return temporary / name
    fresh = tempfile.mkdtemp(prefix="rsea_ros-")
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    return Path(fresh)


def private(folder: Path, forbidden: int = 0o022) -> bool:
    """Return whether only this user can write to a folder, and no stranger to its parent; make it if missing.

    forbidden: mode bits that it may not have.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        if _strangers(folder.parent.stat()):
            return False
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        at = folder.lstat()
    except OSError:
        return False
    alone = stat.S_ISDIR(at.st_mode) and at.st_uid == os.geteuid() and not at.st_mode & forbidden
    return alone and os.access(folder, os.W_OK)


def _strangers(parent: os.stat_result) -> bool:
    """Return whether another user could put a folder of his in the place of one in here."""
    sticky = parent.st_mode & stat.S_ISVTX
    return parent.st_uid not in (0, os.geteuid()) or bool(parent.st_mode & 0o002 and not sticky)


PATIENCE = 30.0
"""s. The longest compilation of one function takes 3."""

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
        if code is None and _turn.take(os.path.dirname(self.cache_path)):
            return self.load_overload(sig, target_context)  # another process may have compiled it meanwhile
        if code is None:
            tell_once()
        else:
            _turn.give_back()
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            warn_once(error.strerror or str(error))
        _turn.give_back()


class _Turn:
    """One process compiles at a time: the others load what it has stored, and no index loses an entry.

    A process takes its turn with the first function that is not stored, and gives it back when that is. numba
    compiles in one thread at a time. Whoever compiles for longer than PATIENCE is not waited for.
    """

    def __init__(self) -> None:
        self._lock: int | None = None

    def take(self, folder: str) -> bool:
        """Wait for the turn; return whether this process did not have it before."""
        if self._lock is not None:
            return False
        with suppress(OSError):
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            begun = time.monotonic()
            while time.monotonic() - begun < PATIENCE:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    time.sleep(0.02)
                else:
                    self._lock = lock
                    return True
            os.close(lock)
        return False

    def give_back(self) -> None:
        """Let another process compile."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


_turn = _Turn()


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


_SETTING = threading.Lock()


@contextmanager
def _own_cache() -> Iterator[None]:
    """Let numba keep code in the package's folder, unless the user has named one (NUMBA_CACHE_DIR).

    One thread at a time: the setting is numba's own, for all of them.
    """
    settings: Any = numba_config
    with _SETTING:
        users = settings.CACHE_DIR
        settings.CACHE_DIR = users or _folder()
        try:
            yield
        finally:
            settings.CACHE_DIR = users


@lru_cache(maxsize=1)
def _folder() -> str:
    return str(cache_folder())
