"""The folder of compiled code in the user's cache: a new one for every change of shared functions.

Numba stores machine code beside the source and recompiles it when the file of the function changes. It does
not see that a function of another file was compiled into it, and it cannot write into an installed package.

Code in the folder is executed, so it is used only where nobody but this user (or root) can have written it.
"""

from __future__ import annotations

import hashlib
import os
import stat
from contextlib import suppress
from pathlib import Path

SHARED = (
    "effects/_*.py", "effects/effect.py", "effects/signal_table.py", "effects/spring_hysteresis.py",
    "model/compiled_call.py", "model/drive.py", "model/step.py",
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
