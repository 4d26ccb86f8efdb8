"""A million recordings on a hundred workers: a simulation by events, with the costs of `fleet.py cost`.

Clients and schedulers are one process that serves one thing at a time: fingerprints that end, tasks that end,
rows that are written. The store is listed once, and compacted as it grows.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass

RECORDINGS, WORKERS = 1_000_000, 100
CLIENT_S, KEYS_S = 0.016, 0.8
"""s of the client for each task, and for the keys of 10^5 rows: `cost scheduler`, `cost reading`."""
PER_WORKER = 3
"""As in cluster.py."""


@dataclass(frozen=True)
class Costs:
    """s. work: of a task, mean of an exponential; client: of the one process for each task, all in all.

    bandwidth: bytes a second that the storage gives to all workers together. size: bytes of a recording.
    """

    work: float
    client: float
    bandwidth: float = 1e9
    size: float = 6e6


def simulate(costs: Costs, tasks: int, workers: int = WORKERS, seed: int = 1) -> tuple[float, float, float]:
    """Return tasks a second, and the shares of time that the workers and the client are busy."""
    rng, now, client_free, storage_free = random.Random(seed), 0.0, 0.0, 0.0
    ends: list[float] = []
    busy, begun, done = 0.0, 0, 0

    def begin(at: float) -> None:
        nonlocal begun, busy, storage_free
        storage_free = max(storage_free, at) + 2.0 * costs.size / costs.bandwidth  # fingerprint, then reading
        took = rng.expovariate(1.0 / costs.work)
        heapq.heappush(ends, max(at, storage_free) + took)
        busy += took
        begun += 1

    for _ in range(min(workers, tasks)):
        begin(now)
    while ends:
        now = heapq.heappop(ends)
        client_free = max(client_free, now) + costs.client
        done += 1
        if begun < tasks:
            # a worker that ends takes the next task that waits; the client refills the queue at its pace
            late = client_free - PER_WORKER * workers * costs.client
            begin(max(now, late))
    whole = max(now, client_free)
    return done / whole, busy / (workers * whole), done * costs.client / whole


def report(line: Callable[..., bool]) -> bool:
    """Print the simulated rates for several kinds of work, and what breaks first."""
    for work in (0.5, 5.0, 60.0):
        rate, workers, client = simulate(Costs(work, CLIENT_S), 50_000)
        hours = RECORDINGS / rate / 3600.0
        said = f"{rate:.0f} a second, {hours:.1f} h; workers busy {workers:.0%}, client {client:.0%}"
        line(f"10^6, 100 workers, {work:g} s each", "–", said)
    rate, workers, client = simulate(Costs(5.0, CLIENT_S, bandwidth=1e8), 50_000)
    line("… storage of 100 MB/s", "–", f"{rate:.0f} a second; workers busy {workers:.0%}")
    most = 1.0 / CLIENT_S
    first = f"the client, at {most:.0f} rows a second: work of less than {WORKERS / most:.1f} s a recording"
    line("what breaks first", "–", first)
    start = f"{KEYS_S * RECORDINGS / 1e5:.0f} s for the keys of rows that are there"
    line("the start of a run", "–", start)
    return True
