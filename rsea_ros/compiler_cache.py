"""Where compiled code is kept: a folder of the user's cache, another one for other shared functions.

Numba keeps machine code beside the source and makes it anew when the file of the function changes. It does
not see that a function of another file was compiled into it, and it cannot write into an installed package.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

SHARED = ("effects/_*.py", "effects/effect.py", "effects/signal_table.py", "model/call.py", "model/drive.py",
          "model/step.py", "model/observer/filter.py", "model/observer/log.py",
          "model/observer/transition.py")  # fmt: skip
"""Files whose functions and constants are compiled into those of other files."""


def choose_cache() -> None:
    """Name the folder in NUMBA_CACHE_DIR, unless the user has. Must run before numba is imported."""
    if "NUMBA_CACHE_DIR" not in os.environ:
        os.environ["NUMBA_CACHE_DIR"] = str(user_cache() / shared_key(Path(__file__).parent))


def shared_key(package: Path) -> str:
    """Return a digest of the contents of the shared files of a package."""
    digest = hashlib.blake2b(digest_size=8)
    for pattern in SHARED:
        for file in sorted(package.glob(pattern)):
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def user_cache() -> Path:
    """Return a folder that this user can write to: the cache of the home, else one for temporary files."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    there = next((folder for folder in (home, *home.parents) if folder.exists()), Path("/"))
    if home.is_absolute() and os.access(there, os.W_OK):
        return home / "rsea_ros"
    from tempfile import gettempdir  # 9 ms that hardly anyone needs

    return Path(gettempdir()) / f"rsea_ros-{os.getuid()}"
