"""The start-up of a worker process on this machine; Dask calls it (SETTINGS in cluster.py)."""

from __future__ import annotations

import signal


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C to the client, which ends the workers: each would print where it was."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
