"""The server with a source that makes up its samples, and a commander."""

from __future__ import annotations

import math
import time

import pytest

from rsea_extras.watch.command import Bounds, Commander
from rsea_extras.watch.desk import Runs
from rsea_extras.watch.server import CHANNELS, Server


class MadeUp:
    """A sine in every channel at 280 Hz, and a node with a name that is no HTML."""

    flag = True

    def __init__(self):
        self._begin = self._last = time.monotonic()

    def take(self):
        first, self._last = self._last, time.monotonic()
        times = [first + k / 280.0 for k in range(int(280.0 * (self._last - first)))]
        return {
            name: [(t - self._begin, (k + 1) * math.sin(t)) for t in times] for k, name in enumerate(CHANNELS)
        }

    def state(self):
        told = {"name": "/rsea/<b>plant", "level": 1, "message": "11 cycles missed", "values": [("a", "1")]}
        return {"bench": "rsea · made up", "health": [told], "rates": {"ft": 280}}


@pytest.fixture
def commander():
    return Commander(Bounds(10.0))


@pytest.fixture
def server(tmp_path, commander):
    """A server that runs, on any port."""
    made = Server(MadeUp(), Runs(tmp_path / "runs"), commander)
    made.start()
    yield made
    made.stop()
