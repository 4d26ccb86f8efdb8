"""The kernel's workers that carry the bytes of a pseudo-terminal, at SCHED_FIFO just below the nodes.

They are the wire, which no process can hold up. At normal priority beside processes that compute, a worker
waits for tens to hundreds of ms, and so does whoever polls the terminal: Linux lets a poll of a terminal wait
for its worker (tty_buffer_flush_work in n_tty_poll). Above the nodes, workers of the disk would delay them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def hurried_wire(priority: int) -> Iterator[None]:
    """Let the workers run at a priority of SCHED_FIFO within the block; 0 or not permitted: as before."""
    workers = _workers() if priority else []
    try:
        for worker in workers:
            _schedule(worker, os.SCHED_FIFO, priority)
        yield
    finally:
        for worker in workers:
            _schedule(worker, os.SCHED_OTHER, 0)


def _schedule(worker: int, policy: int, priority: int) -> None:
    with suppress(PermissionError, ProcessLookupError):
        os.sched_setscheduler(worker, policy, os.sched_param(priority))


def _workers() -> list[int]:
    """Return the threads of the kernel's workers that are bound to no processor."""
    names = {}
    for place in Path("/proc").glob("[0-9]*/comm"):
        with suppress(OSError):  # it has ended meanwhile
            names[int(place.parent.name)] = place.read_text()
    return [number for number, name in names.items() if name.startswith("kworker/u")]
